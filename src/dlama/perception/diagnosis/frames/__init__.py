"""Posed frames of one scene in; findings on their poses, and on frames that do not fit the others, out.

Begin with `landing`: points of one frame reprojected to another, which `poses` and `odd_frames` compare.
"""
