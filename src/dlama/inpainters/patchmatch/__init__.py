"""The filler `patchmatch`: a View with holes in; depth of continued surfaces, and colours from patches of the picture, out.

Begin with `filler` (the filler) and `completion` (coarse to fine). `layered` copies such patches over its surfaces.
"""
