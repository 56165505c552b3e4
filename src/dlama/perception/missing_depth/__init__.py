"""Missing depth where colours are known: known surfaces in; depth extended along colours out.

Begin with `along_colors`. `kernels` is numba alone.
"""
