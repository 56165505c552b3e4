"""The fillers `layered` and `layered-patches`: a View with holes in; surfaces continued behind each hole, then painted, out.

Begin with `filler` (both steps on one screen). `depth` continues surfaces into the hole, `color` spreads their colours,
`depth_first` lets another filler paint them, `remaining_shadows` hides the shadow of a removed object from every painter.
`kernels` is numba alone.
"""
