"""Where a picture has colours and no depth: known surfaces in; depth that continues as the colours do, out.

Begin with `along_colors`. `kernels` is numba alone.
"""
