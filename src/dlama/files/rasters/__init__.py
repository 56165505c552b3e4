"""Picture, mask, depth and disparity files in; arrays in the package's units out, and back.

Begin with `pictures` (colour, masks) and `depth` (metres); `images` and `float_files` decode without units.
"""
