"""The filler `patchmatch`: a View with holes in; depth of continued surfaces, and colours from patches of the picture, out.

Begin with `filler` (the filler; `over_layers`: the one that uses the depth of `layered`) and `completion` (coarse to fine).
"""
