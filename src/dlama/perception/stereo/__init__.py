"""Rectified pairs in; disparities, how well they agree, what speaks against a pair, and masks carried over out.

Begin at `matching`; `networks` is the same job done by a network file.
"""
