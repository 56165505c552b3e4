"""One layer and a camera in; its pixels on a canvas, for `rendering` and the merging of frames, out.

Begin with `layers` (surfaces, points, sky). `picture_edges` aligns depth edges with the picture before a layer is drawn; `gaps`
closes gaps between drawn surfaces.
"""
