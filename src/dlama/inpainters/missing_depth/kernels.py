"""Numba kernel of depth on no plane: a picture and guesses in; depth that runs smoothly between what is known out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, kernel
from dlama.geometry.rgbd import Float32Array


@kernel
def relax(
    values: Float32Array,
    pixels: NDArray[np.int32],
    begin: Float32Array,
    color: Float32Array,
    step: Real,
    power: Real,
    jump: Real,
    keep: Real,
    over: Real,
    sweeps: Whole,
) -> None:
    """Values of `pixels` (flat, in row-major order) drawn to those of their four neighbours, by successive over-relaxation.

    It minimises the sum of c (difference of neighbours)^2 + keep (difference from `begin`)^2. Neighbours that differ by d levels
    (root of the sum over channels) have c = (1 + (d / step)^2)^-power, at least (1 + (e / jump)^2)^-2 where e is their relative
    difference in `begin`. values, begin: H x W, the first is written to; neighbours with the value 0 (far, unknown) do not count.
    color: H x W x 3; over: the factor of over-relaxation, 1 to 2.
    """
    rows, columns = values.shape
    for turn in range(sweeps):
        for m in range(len(pixels)):
            n = m if turn % 2 == 0 else len(pixels) - 1 - m
            row, column = pixels[n] // columns, pixels[n] % columns
            own = float(begin[row, column])
            total, weight = keep * own, float(keep)
            for k in range(4):
                y = row + (1 if k == 0 else 0) - (1 if k == 1 else 0)
                x = column + (1 if k == 2 else 0) - (1 if k == 3 else 0)
                if y < 0 or y >= rows or x < 0 or x >= columns or values[y, x] <= 0:
                    continue
                unlike = 0.0
                for channel in range(3):
                    unlike += (color[row, column, channel] - color[y, x, channel]) ** 2
                apart = (begin[y, x] - own) / (jump * own)
                drawn = max((1.0 + unlike / (step * step)) ** -power, 1.0 / (1.0 + apart * apart) ** 2)
                total += drawn * values[y, x]
                weight += drawn
            values[row, column] += over * (total / weight - values[row, column])
