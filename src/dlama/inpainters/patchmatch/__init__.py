"""The filler `patchmatch`: a View with holes in; surfaces continued, and patches of the picture itself as their colours, out.

Begin with `filler` (how it stands among fillers; `over_layers`: after `layered`) and `completion` (rounds from the coarse picture
to the fine one).
"""
