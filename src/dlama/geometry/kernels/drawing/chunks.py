"""Numba kernels that skip: vertices of the source grid in; which chunks of a row of its quads may touch target pixels out.

For `rasterize` and `hole_types`, which walk over all quads for each band of target rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Flag, Real, Whole, piece
from dlama.geometry.rgbd import Float32Array

Box = tuple[Whole, Whole, Whole, Whole]
"""Target pixels, inclusive: left, right, upper, lower."""
NOWHERE = np.float32(np.inf)
CHUNK = 64
"""Source columns that are skipped together where they do not touch a band."""


class Vertices(NamedTuple):
    """The pixel centres of a source picture at their depth, moved into a target picture; H x W each."""

    x: Float32Array
    """Target pixels."""
    y: Float32Array
    w: Float32Array
    """Inverse z in the target (1/m); 0 = nothing, or not in front: x and y may be anything there."""
    spans: Float32Array
    """H x N x 2: smallest and largest target y of a row of vertices, those of CHUNK quads at a time (empty: inf, -inf)."""


@piece
def span_chunks(vertices: Vertices, row: Whole) -> None:
    """Find the spans of a row of vertices."""
    y, w, spans = vertices.y, vertices.w, vertices.spans
    for chunk in range(spans.shape[1]):
        low, high = np.float32(np.inf), np.float32(-np.inf)
        for column in range(chunk * CHUNK, min(y.shape[1], (chunk + 1) * CHUNK + 1)):
            if w[row, column] > 0:
                low = min(low, y[row, column])
                high = max(high, y[row, column])
        spans[row, chunk, 0], spans[row, chunk, 1] = low, high


@piece
def chunk_boxes(
    vertices: Vertices, row: Whole, chunk: Whole, top: Whole, bottom: Whole, columns: Whole, boxes: NDArray[np.int32]
) -> Whole:
    """Target pixels whose centres the quads of a chunk of a row may cover, cut to rows [top, bottom), into `boxes` (4 x CHUNK):
    left, right, upper, lower, inclusive. How many quads there are.

    Vertices that are not there (w = 0) have no position and do not count. Without branches, and with unsigned places, which are
    not checked for being negative: several quads at a time, read in one piece.
    """
    low_x: Real
    low_y: Real
    high_x: Real
    high_y: Real
    x, y, w = vertices.x, vertices.y, vertices.w
    begin = chunk * CHUNK
    count, start = min(x.shape[1] - 1 - begin, CHUNK), np.uintp(begin)
    for number in range(count):
        low_x, high_x, low_y, high_y = NOWHERE, -NOWHERE, NOWHERE, -NOWHERE
        n = np.uintp(number)
        for corner in range(4):
            r, c = np.uintp(row + (corner >> 1)), start + n + np.uintp(corner & 1)
            there, px, py = w[r, c] > 0, x[r, c], y[r, c]
            low_x, high_x = min(low_x, px if there else NOWHERE), max(high_x, px if there else -NOWHERE)
            low_y, high_y = min(low_y, py if there else NOWHERE), max(high_y, py if there else -NOWHERE)
        boxes[0, n] = np.int32(np.ceil(min(max(0.5, low_x), columns + 1.0) - 0.5001))
        boxes[1, n] = np.int32(np.floor(max(min(columns - 0.5, high_x), -1.0) - 0.4999))
        boxes[2, n] = np.int32(np.ceil(min(max(top + 0.5, low_y), bottom + 1.0) - 0.5001))
        boxes[3, n] = np.int32(np.floor(max(min(bottom - 0.5, high_y), top - 1.0) - 0.4999))
    return count


@piece
def box_at(boxes: NDArray[np.int32], n: Whole) -> Box:
    """The box of quad n of a chunk; boxes: as of `chunk_boxes`."""
    return np.int64(boxes[0, n]), np.int64(boxes[1, n]), np.int64(boxes[2, n]), np.int64(boxes[3, n])


@piece
def marked_within(count: NDArray[np.integer], left: Whole, right: Whole, upper: Whole, lower: Whole) -> Whole:
    """How many marked pixels a box (inclusive) holds; count: their summed-area table, (H + 1) x (W + 1)."""
    return count[lower + 1, right + 1] - count[upper, right + 1] - count[lower + 1, left] + count[upper, left]


@piece
def chunk_meets(spans: Float32Array, row: Whole, chunk: Whole, first: Whole, last: Whole) -> Flag:
    """True if a chunk of a row of quads may touch target rows [first, last)."""
    low, high = min(spans[row, chunk, 0], spans[row + 1, chunk, 0]), max(spans[row, chunk, 1], spans[row + 1, chunk, 1])
    return low <= last and high >= first
