"""A coarse grid and pixels of a larger picture in; the grid's values there, bilinear, out (numba)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, as_input, in_bands, kernel, piece
from dlama.geometry.rgbd import Float32Array

Neighbours = tuple[Whole, Whole, Real]
"""The two cells around a coordinate, and the offset to the second, 0 .. 1."""
Places = NDArray[np.int64]
"""N flat, row-major indices of pixels."""


@piece
def neighbours_of(x: Real, size: Whole) -> Neighbours:
    """The two cells around a coordinate (cell centres at +0.5, clamped to the edge), and the offset to the second."""
    f = x - 0.5
    f = 0.0 if f < 0 else (size - 1.0 if f > size - 1.0 else f)
    x0 = np.int64(f)
    return x0, (x0 + 1 if x0 + 1 < size else size - 1), f - x0


@kernel
def enlarge_rows(
    first: Whole,
    last: Whole,
    grid: Float32Array,
    pixels: Places,
    width: Whole,
    cell: tuple[Real, Real],
    out: Float32Array,
) -> None:
    """Pixels [first, last) of `enlarge_at`. out: N x C."""
    rows, columns, channels = grid.shape
    for n in range(first, last):
        x0, x1, along = neighbours_of((pixels[n] % width + 0.5) / cell[1], columns)
        y0, y1, down = neighbours_of((pixels[n] // width + 0.5) / cell[0], rows)
        for k in range(channels):
            top = grid[y0, x0, k] + along * (float(grid[y0, x1, k]) - grid[y0, x0, k])
            low = grid[y1, x0, k] + along * (float(grid[y1, x1, k]) - grid[y1, x0, k])
            out[n, k] = np.float32(top + down * (low - top))


def enlarge_at(grid: Float32Array, pixels: Places, width: int, cell: tuple[float, float]) -> Float32Array:
    """N x C: a grid (rows x columns x C) of cells of so many pixels (height, width), at the pixels of a picture `width` wide."""
    out = np.empty((len(pixels), grid.shape[2]), np.float32)
    high, wide = (float(side) for side in cell)
    in_bands(enlarge_rows, len(pixels), as_input(grid), as_input(pixels), width, (high, wide), out, band=4096)
    return out
