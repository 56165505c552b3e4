"""Files in; nouns out, and back: units, axes, pixel centres and depth codes are converted here and nowhere else.

Begin at `rgbd` (a picture, its depth, its camera) and `results` (everything that a completion is written to).
"""
