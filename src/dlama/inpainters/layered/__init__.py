"""The filler `layered`: a View with holes in; surfaces continued behind each hole, then painted with their own texture, out.

Begin with `filler` (both steps on one screen). `depth` continues surfaces into the hole, `color` paints them, `depth_first` lets
another filler paint them, `remaining_shadows` hides the shadow of a removed object from every painter. `kernels` is numba alone.
"""
