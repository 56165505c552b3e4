"""Numba kernels of depth that follows colours: a picture and what is known of its depth in; what each pixel belongs to, and
depth that runs smoothly between what is known, out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array

DIAGONAL = 1.41421356
"""Length of a step to a diagonal neighbour, in pixels."""


@kernel
def nearest_by_color(
    distance: Float32Array,
    source: NDArray[np.int32],
    free: BoolArray,
    color: Float32Array,
    step: Real,
    dearest: Real,
    rounds: Whole,
) -> None:
    """The known pixel at the end of the shortest way through `free` pixels, by raster sweeps there and back (8 neighbours).

    distance: H x W, 0 at known pixels, large elsewhere; source: H x W, the flat index of itself at known pixels, negative
    elsewhere; both are written to. color: H x W x 3. A pixel that differs by d levels (root of the sum over channels) from the
    one before it on the way and by e from the known pixel makes the way 1 + (d / step)^2 + (e / step)^2 times as long there, each
    term at most `dearest`.
    """
    rows, columns = free.shape
    for turn in range(2 * rounds):
        way = 1 if turn % 2 == 0 else -1
        for i in range(rows):
            row = i if way == 1 else rows - 1 - i
            for j in range(columns):
                column = j if way == 1 else columns - 1 - j
                if not free[row, column]:
                    continue
                best, chosen = float(distance[row, column]), source[row, column]
                for k in range(4):
                    y = row - way * (0 if k == 0 else 1)
                    x = column - way * (1 if k == 0 else k - 2)
                    if y < 0 or y >= rows or x < 0 or x >= columns or source[y, x] < 0:
                        continue
                    known = source[y, x]
                    there, across = known // columns, known % columns
                    before, own = 0.0, 0.0
                    for channel in range(3):
                        level = float(color[row, column, channel])
                        before += (level - color[y, x, channel]) ** 2
                        own += (level - color[there, across, channel]) ** 2
                    longer = 1.0 + min(before / (step * step), dearest) + min(own / (step * step), dearest)
                    length = DIAGONAL if k == 1 or k == 3 else 1.0
                    if distance[y, x] + length * longer < best:
                        best, chosen = distance[y, x] + length * longer, known
                distance[row, column], source[row, column] = best, chosen


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
