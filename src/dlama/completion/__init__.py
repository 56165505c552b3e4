"""An RGBD or a stereo pair in; a Completion out.

Begin at `pipeline`; `steps` has each of its steps, `stereo` does the same for a pair, `recipes` says how.
"""
