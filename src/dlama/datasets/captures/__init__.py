"""What a capture app or a robot recorded in, a folder or one file; posed frames, and the pairs that make a case, out.

Those of phones share `lidar_frame` (posed/posed_frames.py): confidence, range, and depth that is smaller than its picture.
"""
