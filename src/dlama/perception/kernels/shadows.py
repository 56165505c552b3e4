"""Numba kernel of shadows: an object's points, directions of light and a map in; sums of the map over each cast shape out."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Flag, Whole, inlined, kernel
from dlama.geometry.rgbd import BoolArray

DIRECTIONS_A_TASK = 16


@inlined
def is_at_rim(stamp: NDArray[np.int32], mark: Whole, v: Whole, u: Whole) -> Flag:
    """Whether a pixel with the mark has a neighbour without it; not where it lies on the picture's border."""
    if v == 0 or u == 0 or v == stamp.shape[0] - 1 or u == stamp.shape[1] - 1:
        return False
    return stamp[v - 1, u] != mark or stamp[v + 1, u] != mark or stamp[v, u - 1] != mark or stamp[v, u + 1] != mark


@inlined
def sum_shape(
    stamp: NDArray[np.int32],
    mark: Whole,
    box: tuple[Whole, Whole, Whole, Whole],
    values: Float64Array,
    seen: BoolArray,
    out: Float64Array,
) -> None:
    """Add up (out: 3) the values, pixels and border pixels of the shape with a mark, where it is seen; box: first and last row,
    first and last column that may hold it."""
    for v in range(box[0], box[1] + 1):
        for u in range(box[2], box[3] + 1):
            if stamp[v, u] != mark or not seen[v, u]:
                continue
            out[0] += values[v, u]
            out[1] += 1
            if is_at_rim(stamp, mark, v, u):
                out[2] += 1


@kernel
def cast_shapes(
    first: Whole,
    last: Whole,
    base: Float64Array,
    rise: Float64Array,
    over: Float64Array,
    lens: Float64Array,
    values: Float64Array,
    seen: BoolArray,
    stamps: NDArray[np.int32],
    out: Float64Array,
) -> None:
    """For directions first <= k < last: out[k] = sum of values, count of pixels, count of border pixels of the cast shape.

    Each point covers 2 x 2 pixels; only pixels of `seen` count.

    base: N x 3 points on the surface in camera axes; rise: N heights, m. over: K x 3, metres over the surface for each metre of
    height. lens: fx, fy, cx, cy. values, seen: H x W. stamps: H x W planes of zeros, one for each task of DIRECTIONS_A_TASK
    directions. out: K x 3.
    """
    height, width = values.shape
    for k in range(first, last):
        stamp, mark = stamps[k // DIRECTIONS_A_TASK], k + 1
        top, bottom, left, right = height, -1, width, -1
        for i in range(len(base)):
            z = base[i, 2] + rise[i] * over[k, 2]
            if z <= 1e-3:
                continue
            x = (base[i, 0] + rise[i] * over[k, 0]) / z * lens[0] + lens[2]
            y = (base[i, 1] + rise[i] * over[k, 1]) / z * lens[1] + lens[3]
            if not (-1 <= x < width and -1 <= y < height):
                continue
            column, row = int(math.floor(x)), int(math.floor(y))
            for v in range(max(row, 0), min(row + 2, height)):
                for u in range(max(column, 0), min(column + 2, width)):
                    stamp[v, u] = mark
                    top, bottom = min(top, v), max(bottom, v)
                    left, right = min(left, u), max(right, u)
        sum_shape(stamp, mark, (top, bottom, left, right), values, seen, out[k])
