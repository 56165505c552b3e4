"""The filler `layered`: a View with holes in; surfaces continued behind each hole, then painted with their own texture, out.

Begin with `filler` (both steps on one screen). Depth: `perception.planes` finds the known planes, `surfaces` continues them,
`out_of_view` estimates how far outside the source's view. Colour: `texture_synthesis` paints each surface with its own texture,
`patch_offsets` finds the offsets to copy from, `low_frequency` blends far guesses out of view. `depth_first` lets another
filler paint the colours. `kernels` is numba alone.
"""
