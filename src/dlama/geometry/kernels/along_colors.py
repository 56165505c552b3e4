"""Numba kernel of geodesic paths in colour: a picture and known pixels in; the nearest known pixel of each other pixel out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array

DIAGONAL = 1.41421356
"""Length of a step to a diagonal neighbour, in pixels."""
STEP, DEAREST = 8.0, 60.0
"""Colour step in levels that doubles a path's cost, and the largest cost of a step."""


class DepthCost(NamedTuple):
    """What it costs a path to reach a pixel whose measured depth is another surface's."""

    w: Float32Array
    """H x W inverse depth, 1/m; 0 = unknown."""
    ratio: float
    """Relative step of w between neighbours up to which they are one surface."""
    added: float
    """px."""


@kernel
def nearest_by_color(
    distance: Float32Array,
    source: NDArray[np.int32],
    free: BoolArray,
    color: Float32Array,
    against: DepthCost,
    rounds: Whole,
) -> None:
    """The known pixel at the end of the shortest path through `free` pixels, by raster sweeps there and back (8 neighbours).

    distance: H x W, 0 at known pixels, elsewhere the longest path that counts; source: H x W, the flat index of itself at known
    pixels, negative elsewhere; both are written to. color: H x W x 3. A step costs its length times 1 + (d / STEP)^2 + (e /
    STEP)^2, where d is the colour difference (root of the sum over channels) to the previous pixel and e that to the known
    pixel, each term at most DEAREST; and more where measured depth is `against` it.
    """
    w, ratio, contrary = against
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
                    longer = 1.0 + min(before / (STEP * STEP), DEAREST) + min(own / (STEP * STEP), DEAREST)
                    here, other = w[row, column], w[there, across]
                    away = float(max(abs(there - row), abs(across - column)))
                    if here > 0 and abs(here - other) > ratio * (2.0 + away) * max(here, other):
                        longer += contrary
                    length = DIAGONAL if k == 1 or k == 3 else 1.0
                    if distance[y, x] + length * longer < best:
                        best, chosen = distance[y, x] + length * longer, known
                distance[row, column], source[row, column] = best, chosen
