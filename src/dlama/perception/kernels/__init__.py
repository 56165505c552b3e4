"""Numba kernels of perception: arrays in; the arrays they are handed, filled, out."""
