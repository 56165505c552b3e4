"""Numba kernels of drawing: source pixels in; z-buffers, pictures, hole types and merged frames over target pixels out.

Begin with `rasterize`; `shading` turns its z-buffers into pictures.
"""
