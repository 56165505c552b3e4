"""Numba kernels of hole types: the source grid as one closed mesh (all neighbours joined) in; ranks of the holes it covers out.

Where the closed mesh covers an empty target pixel, the source camera looked at that place but something hid it, or nothing was
measured; where it does not, the place is out of the source's view. Where several types apply, the highest rank wins.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.drawing.chunks import CHUNK, Box, box_at, chunk_boxes, chunk_meets, marked_within, quad_span
from dlama.geometry.kernels.drawing.rasterize import quad_sides
from dlama.geometry.kernels.jit import Flag, Real, Whole, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

DISOCCLUDED_RANK = 1
SENSOR_RANK = 2
FLYING_RANK = 3
OBJECT_RANK = 4
CRACK_RANK = 5


@piece
def is_inside(x0: Real, y0: Real, x1: Real, y1: Real, x2: Real, y2: Real, px: Real, py: Real) -> Flag:
    """True if a point lies in a triangle of either orientation."""
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if abs(area) <= 1e-9:
        return False
    b1 = ((px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)) / area
    b2 = ((x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)) / area
    return b1 >= -1e-4 and b2 >= -1e-4 and b1 + b2 <= 1.0001


@kernel
def mark_closed_mesh(
    first: Whole,
    last: Whole,
    x: Float32Array,
    y: Float32Array,
    w: Float32Array,
    spans: Float32Array,
    joined: UInt8Array,
    grid_rank: UInt8Array,
    crack_rank: Whole,
    hole: BoolArray,
    count: NDArray[np.integer],
    boxes: NDArray[np.int32],
    ranks: UInt8Array,
) -> None:
    """Draw the whole closed grid over the empty pixels of target rows [first, last).

    x, y, w: target pixels and inverse depth of every source pixel (closed: no gaps); spans: as of `chunks.span_chunks`;
    grid_rank: uint8, SENSOR / OBJECT ranks of source pixels that are not there, else 0; crack_rank: what an unbroken quad over
    an empty pixel means; count: summed-area table of `hole`.
    """
    height, width = x.shape
    columns = hole.shape[1]
    for row in range(height - 1):
        for chunk in range(spans.shape[1]):
            low, high = quad_span(spans, row, chunk)
            if not chunk_meets(x, w, row, chunk, low, high, first, last, count):
                continue
            begin, end, room = chunk * CHUNK, min(width - 1, (chunk + 1) * CHUNK), boxes[first]
            chunk_boxes(x, y, w, row, begin, end, first, last, columns, room)
            for n in range(end - begin):
                box = box_at(room, n)
                if box[0] <= box[1] and box[2] <= box[3] and marked_within(count, box[0], box[1], box[2], box[3]) > 0:
                    mark_quad(x, y, w, joined, grid_rank, row, begin + n, crack_rank, box, hole, ranks)


@piece
def mark_quad(
    x: Float32Array,
    y: Float32Array,
    w: Float32Array,
    joined: UInt8Array,
    grid_rank: UInt8Array,
    row: Whole,
    column: Whole,
    crack_rank: Whole,
    box: Box,
    hole: BoolArray,
    ranks: UInt8Array,
) -> None:
    """One quad of the closed mesh, if all of it is in front of the near plane.

    Its rank: the highest of its pixels' own; else a crack where it is one surface; else a dis-occlusion.
    """
    wa, wb, wc, wd = w[row, column], w[row, column + 1], w[row + 1, column], w[row + 1, column + 1]
    if min(min(wa, wb), min(wc, wd)) <= 0:
        return
    rank = max(
        max(grid_rank[row, column], grid_rank[row, column + 1]),
        max(grid_rank[row + 1, column], grid_rank[row + 1, column + 1]),
    )
    if rank == 0:
        rank = crack_rank if quad_sides(joined, row, column) == 15 else DISOCCLUDED_RANK
    for ty in range(box[2], box[3] + 1):
        for tx in range(box[0], box[1] + 1):
            if hole[ty, tx] and ranks[ty, tx] < rank and quad_covers(x, y, row, column, tx + 0.5, ty + 0.5):
                ranks[ty, tx] = rank


@piece
def quad_covers(x: Float32Array, y: Float32Array, row: Whole, column: Whole, px: Real, py: Real) -> Flag:
    """True if a point lies in one of a quad's two triangles."""
    xb, yb, xc, yc = x[row, column + 1], y[row, column + 1], x[row + 1, column], y[row + 1, column]
    return is_inside(x[row, column], y[row, column], xb, yb, xc, yc, px, py) or is_inside(
        xb, yb, x[row + 1, column + 1], y[row + 1, column + 1], xc, yc, px, py
    )


def mark_points(
    x: Float32Array, y: Float32Array, w: Float32Array, chosen: BoolArray, rank: int, hole: BoolArray, ranks: UInt8Array
) -> None:
    """Raise the rank at the nearest target pixel of each chosen source pixel, where that is a hole. (numpy: they are few.)"""
    there = np.flatnonzero(chosen & (w > 0))
    px, py = x.ravel()[there], y.ravel()[there]
    inside = (px >= 0) & (py >= 0) & (px < hole.shape[1]) & (py < hole.shape[0])
    tx, ty = px[inside].astype(np.int64), py[inside].astype(np.int64)
    tx, ty = tx[hole[ty, tx]], ty[hole[ty, tx]]
    ranks[ty, tx] = np.maximum(ranks[ty, tx], np.uint8(rank))
