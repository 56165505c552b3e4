"""Numba kernels of soft borders: pixels near depth edges, their colours and both surfaces in; the near one's share out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, inlined, kernel, piece
from dlama.geometry.rgbd import Float32Array, UInt8Array

NEAR_SAMPLE, FAR_SAMPLE = 1, 2
CONTRAST = 30.0
"""Levels (root of the sum over channels) by which two colours must differ to tell how a pixel is mixed of them."""
MIXED, PRIOR = 20.0, 60.0
"""Levels by which a sample that may be mixed itself counts as further off, and a share that contradicts the depth."""


@piece
def step_of(one: UInt8Array, other: UInt8Array, channel: Whole) -> Real:
    """Levels from one colour to another in a channel."""
    return np.float64(one[channel]) - np.float64(other[channel])


@inlined
def cell_at(grid: Float32Array, y: Whole, x: Whole, step: Whole) -> Real:
    """The value of a grid, one in step x step pixels, at a pixel; beyond its end the last one's."""
    return grid[min(y // step, grid.shape[0] - 1), min(x // step, grid.shape[1] - 1)]


@inlined
def closeness(side: Float32Array, y: Whole, x: Whole, step: Whole, reach: Real) -> Real:
    """How near a pixel is to the edge: 1 at it, 0 from `reach` on."""
    return 1.0 - min(abs(cell_at(side, y, x, step)) / reach, 1.0)


class Border(NamedTuple):
    """A picture, and a grid that has one cell in step x step of its pixels."""

    color: UInt8Array
    """H x W x 3."""
    w: Float32Array
    """Inverse depth (1/m),"""
    middle: Float32Array
    """that of the middle between the two surfaces,"""
    side: Float32Array
    """and signed distance to the edge in cells, > 0 on the near surface, of each cell."""
    step: Whole
    reach: Real
    """The largest distance."""


class Unmixed(NamedTuple):
    """Of each pixel the near surface's share, H x W, and both surfaces' colours, H x W x 3."""

    alpha: Float32Array
    front: UInt8Array
    back: UInt8Array


@inlined
def mark_samples(
    border: Border, row: Whole, column: Whole, offsets: NDArray[np.int32], between: Real, marks: UInt8Array
) -> None:
    """Which of a pixel's samples are on the near surface, and which on the far one, into `marks` (K); `between`: inverse depth
    between the two."""
    for k in range(len(offsets)):
        y, x = row + offsets[k, 0], column + offsets[k, 1]
        marks[k] = 0
        if 0 <= y < border.color.shape[0] and 0 <= x < border.color.shape[1]:
            there = cell_at(border.w, y, x, border.step)
            if there > 0:
                marks[k] = NEAR_SAMPLE if there > between else FAR_SAMPLE


@inlined
def mix(own: UInt8Array, near: UInt8Array, far: UInt8Array, hard: Real, prior: Real) -> tuple[Real, Real]:
    """The near colour's share in a pixel that is mixed of two, `hard` where they are too alike to tell; and what it costs: the
    rest, and `prior` times its square off `hard`."""
    length, along, here = 0.0, 0.0, 0.0
    for channel in range(3):
        d, e = step_of(near, far, channel), step_of(own, far, channel)
        length += d * d
        along += d * e
        here += e * e
    a = hard
    if length > CONTRAST * CONTRAST:
        a = min(max(along / length, 0.0), 1.0)
    return a, here - 2 * a * along + a * a * length + prior * (a - hard) * (a - hard)


@kernel
def separate(
    first: Whole,
    last: Whole,
    border: Border,
    pixels: NDArray[np.int32],
    offsets: NDArray[np.int32],
    room: UInt8Array,
    out: Unmixed,
) -> None:
    """Of each pixel the pair of samples, one of either surface, that mix to it best: the near one's share, and both colours.

    pixels: N x 2, row and column; offsets: K x 2, of the samples (px). room: N x K.
    """
    color, side, step, reach = border.color, border.side, border.step, border.reach
    for n in range(first, last):
        row, column = pixels[n, 0], pixels[n, 1]
        between, away = cell_at(border.middle, row, column, step), cell_at(side, row, column, step)
        hard = 1.0 if away > 0 else 0.0
        prior = PRIOR * PRIOR * (away / reach) * (away / reach)
        mark_samples(border, row, column, offsets, between, room[n])
        best, share, nearest, farthest = np.inf, hard, -1, -1
        for i in range(len(offsets)):
            if room[n, i] != NEAR_SAMPLE:
                continue
            y, x = row + offsets[i, 0], column + offsets[i, 1]
            near = color[y, x]
            off = closeness(side, y, x, step, reach)
            for j in range(len(offsets)):
                if room[n, j] != FAR_SAMPLE:
                    continue
                y, x = row + offsets[j, 0], column + offsets[j, 1]
                other = closeness(side, y, x, step, reach)
                a, cost = mix(color[row, column], near, color[y, x], hard, prior)
                cost += MIXED * MIXED * (off * off + other * other)
                if cost < best:
                    best, share, nearest, farthest = cost, a, i, j
        out.alpha[row, column] = share
        if farthest >= 0:
            for channel in range(3):
                out.front[row, column, channel] = color[
                    row + offsets[nearest, 0], column + offsets[nearest, 1], channel
                ]
                out.back[row, column, channel] = color[
                    row + offsets[farthest, 0], column + offsets[farthest, 1], channel
                ]


@kernel
def smooth(
    first: Whole, last: Whole, pixels: NDArray[np.int32], color: UInt8Array, alpha: Float32Array, out: Float32Array
) -> None:
    """Of each pixel (N x 2) the mean share of those in 5 x 5 round it that have its colour; out: N."""
    rows, columns = alpha.shape
    for n in range(first, last):
        row, column = pixels[n, 0], pixels[n, 1]
        total, weights = 0.0, 0.0
        for y in range(max(row - 2, 0), min(row + 3, rows)):
            for x in range(max(column - 2, 0), min(column + 3, columns)):
                square = 0.0
                for channel in range(3):
                    d = step_of(color[y, x], color[row, column], channel)
                    square += d * d
                weight = 1.0 / (1.0 + square / 300.0)
                total += weight * alpha[y, x]
                weights += weight
        out[n] = total / weights
