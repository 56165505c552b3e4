"""Numba kernels of depth on no plane: a picture and guesses in; depth that runs smoothly between what is known out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array


@kernel
def conductances(
    first: Whole,
    last: Whole,
    out: Float32Array,
    where: BoolArray,
    begin: Float32Array,
    color: Float32Array,
    step: Real,
    power: Real,
    jump: Real,
) -> None:
    """How much neighbours are drawn to each other: the pixels of `where` to the right and to the lower one (out: H x W x 2).

    Colours d levels apart (root of the sum over channels) give (1 + (d / step)^2)^-power, values of `begin` (H x W) that differ
    by e of the larger one at least (1 + (e / jump)^2)^-2; a value of 0 (far, unknown) gives 0. where: H x W; color: H x W x 3.
    """
    rows, columns = begin.shape
    for row in range(first, last):
        for column in range(columns):
            for k in range(2):
                y, x = row + k, column + 1 - k
                out[row, column, k] = 0.0
                if not where[row, column] or y >= rows or x >= columns or begin[row, column] <= 0 or begin[y, x] <= 0:
                    continue
                unlike = 0.0
                for channel in range(3):
                    unlike += (color[row, column, channel] - color[y, x, channel]) ** 2
                apart = (begin[y, x] - begin[row, column]) / (jump * max(begin[y, x], begin[row, column]))
                out[row, column, k] = max((1.0 + unlike / (step * step)) ** -power, 1.0 / (1.0 + apart * apart) ** 2)


@kernel
def relax(
    values: Float32Array,
    pixels: NDArray[np.int32],
    begin: Float32Array,
    drawn: Float32Array,
    keep: Real,
    over: Real,
    sweeps: Whole,
) -> None:
    """Values of `pixels` (flat, in row-major order) drawn to those of their four neighbours, by successive over-relaxation.

    It minimises the sum of c (difference of neighbours)^2 + keep (difference from `begin`)^2. values, begin: H x W, the first is
    written to; drawn: H x W x 2, the c to the right and to the lower neighbour; over: the factor of over-relaxation, 1 to 2.
    """
    rows, columns = values.shape
    for turn in range(sweeps):
        for m in range(len(pixels)):
            n = m if turn % 2 == 0 else len(pixels) - 1 - m
            row, column = pixels[n] // columns, pixels[n] % columns
            total, weight = keep * begin[row, column], float(keep)
            if column + 1 < columns:
                total += drawn[row, column, 0] * values[row, column + 1]
                weight += drawn[row, column, 0]
            if column > 0:
                total += drawn[row, column - 1, 0] * values[row, column - 1]
                weight += drawn[row, column - 1, 0]
            if row + 1 < rows:
                total += drawn[row, column, 1] * values[row + 1, column]
                weight += drawn[row, column, 1]
            if row > 0:
                total += drawn[row - 1, column, 1] * values[row - 1, column]
                weight += drawn[row - 1, column, 1]
            values[row, column] += over * (total / weight - values[row, column])
