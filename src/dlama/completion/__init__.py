"""An RGBD, a stereo pair or many frames in; a Completion out.

Begin at `pipeline`; `steps` has each of its steps, `recipes` says how. `stereo/` does the same for a pair, `frames/` for many
frames.
"""
