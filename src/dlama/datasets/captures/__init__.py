"""What a capture app or a robot recorded in, a folder or one file; posed frames, and the pairs that make a case, out.

Begin with `captured_frames`, which those of phones share: confidence, range, and depth that is smaller than its picture.
"""
