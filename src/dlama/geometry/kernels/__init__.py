"""Numba kernels: arrays in, arrays filled in place; no nouns, no files. Plain scalar loops over rows [first, last).

Begin with `jit`, which compiles them and runs them over bands of rows.
"""
