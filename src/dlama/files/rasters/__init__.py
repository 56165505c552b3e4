"""Picture, mask, depth and disparity files in; arrays in the package's units out, and back.

Begin with `pictures` (colour, masks) and `depth` (metres); `images`, `exr_files` and `float_files` decode without units.
"""
