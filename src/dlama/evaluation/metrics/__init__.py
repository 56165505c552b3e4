"""Metrics, pure: an estimate and its truth (arrays) and a region in; numbers out.

Begin with `pictures`; `regions` says which pixels are scored, the same ones for every method.
"""
