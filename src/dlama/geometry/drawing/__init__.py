"""One layer and a camera in; its pixels on a canvas out, as `rendering` and the merging of frames need them.

Begin with `layers` (surfaces, points, sky); `picture_edges` puts depth edges where the picture has them before a layer is drawn,
`gaps` closes what is left open between drawn surfaces.
"""
