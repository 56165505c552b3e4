"""The filler `layered`: a View with holes in; surfaces continued behind each hole, then painted with their own texture, out.

Begin with `filler` (both steps on one screen). Depth: `planes` finds the planes of what is known, `surfaces` continues them,
`out_of_view` says how far where nothing was seen.
Colour: `texture_synthesis` paints each surface with texture of its own, `patch_offsets` says from where it is copied, `hedging`
makes guesses out of view less sure. `depth_first` lets another filler paint the colours. `kernels` is numba alone.
"""
