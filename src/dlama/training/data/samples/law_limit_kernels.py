"""Numba kernel of the law's limit: true inverse depth of a target view in, the nearest lawful one out.

Along a target pixel's ray, with inverse depth w growing from infinity (w = 0) towards the camera, source pixels are
(ax + w ox, ay + w oy) / h, h = az + w oz, and source depth is h / w: all borders and limits are linear in w.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Real, Whole, kernel, piece
from dlama.geometry.kernels.visibility import next_crossing, ray, tolerance
from dlama.geometry.projection import PixelMap
from dlama.geometry.rgbd import BoolArray, Float32Array

NUDGE = 1e-9
"""Relative step over a border between two source pixels."""


@piece
def clip(low: Real, high: Real, a: Real, b: Real) -> tuple[Real, Real]:
    """The part of [low, high] on which a + w b >= 0; low > high where there is none."""
    if b > 0:
        return max(low, -a / b), high
    if b < 0:
        return low, min(high, -a / b)
    return (low, high) if a >= 0 else (np.inf, -np.inf)


@piece
def limit_on_ray(ax: Real, ay: Real, az: Real, offset: Float64Array, w: Real, measured: Float32Array) -> Real:
    """The first inverse depth >= w that breaks the law; inf if none does."""
    rows, columns = measured.shape
    low, high = clip(w, np.inf, az, offset[2])
    low, high = clip(low, high, ax, offset[0])
    low, high = clip(low, high, ay, offset[1])
    low, high = clip(low, high, columns * az - ax, columns * offset[2] - offset[0])
    low, high = clip(low, high, rows * az - ay, rows * offset[2] - offset[1])
    w, along = low, (ax, ay, az)  # a walk along w is one along depth with the ray and its offset exchanged
    for _ in range(4 * (rows + columns)):
        if not w < high:
            return np.inf
        inside = w + NUDGE * (w + 1e-6)
        h = az + inside * offset[2]
        if h <= 0:
            return np.inf
        column = min(max(int((ax + inside * offset[0]) / h), 0), columns - 1)
        row = min(max(int((ay + inside * offset[1]) / h), 0), rows - 1)
        border = next_crossing(offset[0], offset[1], offset[2], along, inside, column, row)
        depth = measured[row, column]
        if depth == np.inf:
            return w
        if depth > 0:
            nearest = depth - tolerance(depth)
            if h < inside * nearest:
                return w
            if nearest > offset[2]:
                breaks = az / (nearest - offset[2])
                if w <= breaks < min(border, high):
                    return breaks
        w = border
    return np.inf


@kernel
def limits(
    first: Whole,
    last: Whole,
    truth: Float32Array,
    where: BoolArray,
    to_source: PixelMap,
    measured: Float32Array,
    out: Float64Array,
) -> None:
    """out (float64 H x W inverse depths): made no larger than the law of one source allows at the pixels of `where`.

    truth: H x W inverse depth (1/m, 0 = far); measured: source depth.
    """
    for row in range(first, last):
        for column in range(truth.shape[1]):
            if where[row, column]:
                ax, ay, az = ray(to_source.matrix, row, column)
                found = limit_on_ray(ax, ay, az, to_source.offset, np.float64(truth[row, column]), measured)
                if found < out[row, column]:
                    out[row, column] = found
