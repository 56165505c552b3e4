"""Numba kernels of hole typing: the source grid as one closed rubber sheet, drawn over the holes of a target view.

Where the stretched sheet covers an empty pixel, the source camera looked at that place but something hid it, or nothing
was measured; where it does not, the place is out of the source's view. Ranks order the answers when several apply.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from dlama.geometry.raster import BAND, quad_sides, row_spans

DISOCCLUDED_RANK = 1
CRACK_RANK = 2
FLYING_RANK = 3
SENSOR_RANK = 4
OBJECT_RANK = 5


@njit(cache=True)
def mark_triangle(x0, y0, x1, y1, x2, y2, rank, top, bottom, hole, ranks):
    """Raise `ranks` to `rank` at the empty pixels of a triangle of either orientation."""
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if abs(area) <= 1e-9:
        return
    left = int(math.ceil(max(0.5, min(x0, x1, x2)) - 0.5))
    right = int(math.floor(min(hole.shape[1] - 0.5, max(x0, x1, x2)) - 0.5))
    upper = int(math.ceil(max(top + 0.5, min(y0, y1, y2)) - 0.5))
    lower = int(math.floor(min(bottom - 0.5, max(y0, y1, y2)) - 0.5))
    scale = 1.0 / area
    for ty in range(upper, lower + 1):
        py = ty + 0.5
        for tx in range(left, right + 1):
            if not hole[ty, tx] or ranks[ty, tx] >= rank:
                continue
            px = tx + 0.5
            b1 = ((px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)) * scale
            b2 = ((x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)) * scale
            if b1 >= -1e-4 and b2 >= -1e-4 and b1 + b2 <= 1.0001:
                ranks[ty, tx] = rank


@njit(cache=True)
def quad_rank(grid_rank, joined, row, column, crack_rank):
    """Rank of a quad: the highest of its pixels' own; else a crack where it is one surface; else a dis-occlusion."""
    own = max(
        max(grid_rank[row, column], grid_rank[row, column + 1]),
        max(grid_rank[row + 1, column], grid_rank[row + 1, column + 1]),
    )
    if own > 0:
        return own
    return crack_rank if quad_sides(joined, row, column) == 15 else DISOCCLUDED_RANK


@njit(cache=True, parallel=True)
def mark_sheet(x, y, z, joined, grid_rank, near, crack_rank, hole, ranks):
    """Draw the whole closed grid over the empty pixels of the target.

    x, y, z: target pixels and depth of every source pixel (closed: no gaps); grid_rank: uint8, SENSOR / OBJECT ranks of
    source pixels that are not there, else 0; crack_rank: what an unbroken quad over an empty pixel means.
    """
    height, width = x.shape
    rows = hole.shape[0]
    spans = row_spans(y, z, near)
    for band in prange((rows + BAND - 1) // BAND):
        top, bottom = band * BAND, min(rows, (band + 1) * BAND)
        if not hole[top:bottom].any():
            continue
        for row in range(height - 1):
            if max(spans[row, 1], spans[row + 1, 1]) < top or min(spans[row, 0], spans[row + 1, 0]) > bottom:
                continue
            for column in range(width - 1):
                mark_quad(x, y, z, joined, grid_rank, row, column, near, crack_rank, top, bottom, hole, ranks)


@njit(cache=True)
def mark_quad(x, y, z, joined, grid_rank, row, column, near, crack_rank, top, bottom, hole, ranks):
    """One quad of the sheet, if all of it is in front of the near plane."""
    if (
        z[row, column] <= near
        or z[row, column + 1] <= near
        or z[row + 1, column] <= near
        or z[row + 1, column + 1] <= near
    ):
        return
    ya, yb, yc, yd = y[row, column], y[row, column + 1], y[row + 1, column], y[row + 1, column + 1]
    if max(max(ya, yb), max(yc, yd)) < top or min(min(ya, yb), min(yc, yd)) > bottom:
        return
    xa, xb, xc, xd = x[row, column], x[row, column + 1], x[row + 1, column], x[row + 1, column + 1]
    rank = quad_rank(grid_rank, joined, row, column, crack_rank)
    mark_triangle(xa, ya, xb, yb, xc, yc, rank, top, bottom, hole, ranks)
    mark_triangle(xb, yb, xd, yd, xc, yc, rank, top, bottom, hole, ranks)


@njit(cache=True)
def mark_points(x, y, z, chosen, near, rank, hole, ranks):
    """Raise the rank at the nearest target pixel of each chosen source pixel."""
    rows, columns = hole.shape
    for row in range(x.shape[0]):
        for column in range(x.shape[1]):
            if not chosen[row, column] or z[row, column] <= near:
                continue
            px, py = x[row, column], y[row, column]
            if not (0 <= px < columns and 0 <= py < rows):
                continue
            tx, ty = int(px), int(py)
            if hole[ty, tx]:
                ranks[ty, tx] = max(ranks[ty, tx], np.uint8(rank))
