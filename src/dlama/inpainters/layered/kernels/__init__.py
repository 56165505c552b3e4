"""Numba kernels of `layered`, one file for each file that calls them; loaded only when it fills."""
