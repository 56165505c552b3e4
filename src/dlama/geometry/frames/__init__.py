"""Posed frames of one scene in; one Scene of them, and the view that all of them together give of a camera, out.

Begin at `gathering` (gains, noise and outliers, from overlaps of frames). `choosing` selects the frames for a camera, `merging`
makes one view of them, `thinning` a cloud with each surface once. `removal` removes an object from them. `stored` reads their
pixels when they are needed, `kept` holds what was found in them.
"""
