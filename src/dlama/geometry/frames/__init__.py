"""Posed frames of one scene in; one Scene of them, and the view that all of them together give of a camera, out.

Begin at `gathering` (what the frames say of each other: gains, noise, outliers); `choosing` decides which frames matter for a
camera, `merging` makes one view of them. `removal` and `adding` make another scene of a scene.
"""
