"""Numba kernel that averages noise: inverse depths in, the same without much of their noise out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.kernels.jit import Real, Whole, kernel
from dlama.geometry.rgbd import Float32Array


@kernel
def average_pairs(
    first: Whole, last: Whole, w: Float32Array, constant: Real, share: Real, reach: Whole, out: Float32Array
) -> None:
    """The mean of each pixel and of those pairs of pixels opposite each other, up to `reach` px away, whose mean is as near to it
    as noise allows: `constant` (1/m), or `share` of it, whichever is more. Planes stay as they are, for they are affine in w.

    w: H x W inverse depth (1/m), 0 = none.
    """
    height, width = w.shape
    for row in range(first, last):
        for column in range(width):
            here = w[row, column]
            out[row, column] = here
            if here <= 0:
                continue
            near, total, count = max(constant, share * here), np.float32(0), 1
            for down in range(min(reach, row, height - 1 - row) + 1):
                wide = min(reach, column, width - 1 - column)
                for right in range(-wide if down else 1, wide + 1):
                    one, other = w[row + down, column + right], w[row - down, column - right]
                    off = np.float32(0.5) * (one + other) - here
                    if one > 0 and other > 0 and abs(off) <= near:
                        total += off
                        count += 2
            out[row, column] = here + 2 * total / count
