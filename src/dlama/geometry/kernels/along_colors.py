"""Numba kernel of geodesic paths in colour: a picture and known pixels in; the nearest known pixel of each other pixel out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Pixel, Real, Whole, inlined, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array

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


@inlined
def step_cost(color: Float32Array, here: Pixel, before: Pixel, known: Pixel, against: DepthCost) -> Real:
    """What a pixel of length costs a path that comes here from the pixel before, from a known pixel at its end."""
    w, ratio, contrary = against
    step, whole = 0.0, 0.0
    for channel in range(3):
        level = float(color[here[0], here[1], channel])
        step += (level - color[before[0], before[1], channel]) ** 2
        whole += (level - color[known[0], known[1], channel]) ** 2
    cost = 1.0 + min(step / (STEP * STEP), DEAREST) + min(whole / (STEP * STEP), DEAREST)
    own, other = w[here[0], here[1]], w[known[0], known[1]]
    away = float(max(np.abs(known[0] - here[0]), np.abs(known[1] - here[1])))
    if own > 0 and abs(own - other) > ratio * (2.0 + away) * max(own, other):
        cost += contrary
    return cost


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
                    end = known // columns, known % columns
                    length = 1.41421356 if k == 1 or k == 3 else 1.0  # px
                    whole = distance[y, x] + length * step_cost(color, (row, column), (y, x), end, against)
                    if whole < best:
                        best, chosen = whole, known
                distance[row, column], source[row, column] = best, chosen
