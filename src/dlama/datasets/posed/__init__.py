"""A folder of posed frames in; its frames, and the pairs that make a case, out. One file for each layout, and its writer.

They share `lenses` (intrinsics), `posed_frames` (files of a frame) and `view_pairs` (which frames make a case).
"""
