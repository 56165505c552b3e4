"""Rectified pairs in; disparities, their consistency, faults of a pair, and transferred masks out.

Begin at `matching`; `networks` does the same by a network file.
"""
