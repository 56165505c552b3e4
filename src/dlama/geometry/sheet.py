"""Numba kernels of hole typing: the source grid as one closed rubber sheet, drawn over the holes of a target view.

Where the stretched sheet covers an empty pixel, the source camera looked at that place but something hid it, or nothing
was measured; where it does not, the place is out of the source's view. Ranks order the answers when several apply.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from dlama.geometry.raster import BAND, CHUNK, quad_box, quad_sides, quad_spans

DISOCCLUDED_RANK = 1
SENSOR_RANK = 2
FLYING_RANK = 3
OBJECT_RANK = 4
CRACK_RANK = 5


@njit(cache=True)
def is_inside(x0, y0, x1, y1, x2, y2, px, py):
    """True if a point lies in a triangle of either orientation."""
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if abs(area) <= 1e-9:
        return False
    b1 = ((px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)) / area
    b2 = ((x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)) / area
    return b1 >= -1e-4 and b2 >= -1e-4 and b1 + b2 <= 1.0001


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
def mark_sheet(x, y, w, joined, grid_rank, crack_rank, hole, ranks):
    """Draw the whole closed grid over the empty pixels of the target.

    x, y, w: target pixels and inverse depth of every source pixel (closed: no gaps); grid_rank: uint8, SENSOR / OBJECT
    ranks of source pixels that are not there, else 0; crack_rank: what an unbroken quad over an empty pixel means.
    """
    height, width = x.shape
    rows, columns = hole.shape
    spans = quad_spans(y, w)
    for band in prange((rows + BAND - 1) // BAND):
        top, bottom = band * BAND, min(rows, (band + 1) * BAND)
        if not hole[top:bottom].any():
            continue
        for row in range(height - 1):
            for chunk in range(spans.shape[1]):
                if spans[row, chunk, 1] < top or spans[row, chunk, 0] > bottom:
                    continue
                for column in range(chunk * CHUNK, min(width - 1, (chunk + 1) * CHUNK)):
                    box = quad_box(x, y, w, row, column, top, bottom, columns)
                    if box[0] <= box[1] and box[2] <= box[3]:
                        mark_quad(x, y, w, joined, grid_rank, row, column, crack_rank, box, hole, ranks)


@njit(cache=True)
def mark_quad(x, y, w, joined, grid_rank, row, column, crack_rank, box, hole, ranks):
    """One quad of the sheet, if all of it is in front of the near plane."""
    wa, wb, wc, wd = w[row, column], w[row, column + 1], w[row + 1, column], w[row + 1, column + 1]
    if min(min(wa, wb), min(wc, wd)) <= 0:
        return
    rank = -1
    for ty in range(box[2], box[3] + 1):
        for tx in range(box[0], box[1] + 1):
            if not hole[ty, tx]:
                continue
            if rank < 0:
                rank = quad_rank(grid_rank, joined, row, column, crack_rank)
            if ranks[ty, tx] < rank and quad_covers(x, y, row, column, tx + 0.5, ty + 0.5):
                ranks[ty, tx] = rank


@njit(cache=True)
def quad_covers(x, y, row, column, px, py):
    """True if a point lies in one of a quad's two triangles."""
    xb, yb, xc, yc = x[row, column + 1], y[row, column + 1], x[row + 1, column], y[row + 1, column]
    return is_inside(x[row, column], y[row, column], xb, yb, xc, yc, px, py) or is_inside(
        xb, yb, x[row + 1, column + 1], y[row + 1, column + 1], xc, yc, px, py
    )


@njit(cache=True)
def mark_points(x, y, w, chosen, rank, hole, ranks):
    """Raise the rank at the nearest target pixel of each chosen source pixel."""
    rows, columns = hole.shape
    for row in range(x.shape[0]):
        for column in range(x.shape[1]):
            if not chosen[row, column] or w[row, column] <= 0:
                continue
            px, py = x[row, column], y[row, column]
            if not (0 <= px < columns and 0 <= py < rows):
                continue
            tx, ty = int(px), int(py)
            if hole[ty, tx]:
                ranks[ty, tx] = max(ranks[ty, tx], np.uint8(rank))
