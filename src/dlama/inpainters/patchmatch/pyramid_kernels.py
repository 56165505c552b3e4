"""What patches are compared by, and where it is known, in; the same at half the size out (numba)."""

from __future__ import annotations

import numpy as np

from dlama.geometry.kernels.jit import Whole, inlined, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array

OUTER, INNER = 0.2389942656229905, 0.7610057343770095
"""Of four pixels in a row under one of half the size: a Gaussian of 0.8 px over three pixels, averaged over two places."""


@inlined
def count_known(hole: BoolArray, row: Whole, column: Whole) -> Whole:
    """Known ones of the four pixels under one of half the size."""
    known = 0
    for y in range(2 * row, min(2 * row + 2, hole.shape[0])):
        for x in range(2 * column, min(2 * column + 2, hole.shape[1])):
            known += not hole[y, x]
    return known


@kernel
def halve_rows(
    first: Whole, last: Whole, values: Float32Array, hole: BoolArray, out: Float32Array, hole_out: BoolArray
) -> None:
    """Rows [first, last) at half the size, rounded up. A pixel is a hole if more than half under it is hole or beyond the border;
    its values (H x W x C) are means of what lies round it: of the known pixels, or in a hole of all."""
    height, width, channels = values.shape
    for row in range(first, last):
        for column in range(out.shape[1]):
            known = count_known(hole, row, column)
            hole_out[row, column] = known < 2
            total = 0.0
            for k in range(channels):
                out[row, column, k] = np.float32(0)
            for j in range(4):
                y = 2 * row - 1 + j
                for i in range(4):
                    x = 2 * column - 1 + i
                    if 0 <= y < height and 0 <= x < width and (known < 2 or not hole[y, x]):
                        down, right = INNER if 0 < j < 3 else OUTER, INNER if 0 < i < 3 else OUTER
                        weight = down * right
                        total += weight
                        for k in range(channels):
                            out[row, column, k] += np.float32(weight) * values[y, x, k]
            for k in range(channels):
                out[row, column, k] = np.float32(out[row, column, k] / total)
