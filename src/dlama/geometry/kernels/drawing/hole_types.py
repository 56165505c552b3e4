"""Numba kernels of hole types: the source grid as one closed mesh (all neighbours joined) in; ranks of the holes it covers out.

Where the closed mesh covers an empty target pixel, the source camera looked at that place but something hid it, or nothing was
measured; where it does not, the place is out of the source's view. Where several types apply, the highest rank wins.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import HoleType
from dlama.geometry.kernels.drawing.chunks import CHUNK, Box, Vertices, box_at, chunk_boxes, chunk_meets, marked_within
from dlama.geometry.kernels.drawing.rasterize import quad_sides
from dlama.geometry.kernels.jit import Flag, Real, Whole, kernel, piece
from dlama.geometry.rgbd import BoolArray, UInt8Array

RISING = (
    HoleType.OUT_OF_VIEW, HoleType.DISOCCLUDED, HoleType.SENSOR, HoleType.FLYING, HoleType.OBJECT, HoleType.CRACK
)  # fmt: skip
"""Hole types in rising precedence where several apply: the place of each is its rank."""
RANK_OF_TYPE = np.array([0, *map(RISING.index, range(1, len(HoleType)))], np.uint8)
DISOCCLUDED_RANK = RISING.index(HoleType.DISOCCLUDED)

Place = tuple[Real, Real]
"""x, y."""


@piece
def is_inside(one: Place, two: Place, three: Place, px: Real, py: Real) -> Flag:
    """True if a point lies in a triangle of either orientation."""
    (x0, y0), (x1, y1), (x2, y2) = one, two, three
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if abs(area) <= 1e-9:
        return False
    b1 = ((px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)) / area
    b2 = ((x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)) / area
    return b1 >= -1e-4 and b2 >= -1e-4 and b1 + b2 <= 1.0001


class ClosedMesh(NamedTuple):
    """The source grid as one mesh, all neighbours joined, and what holes that it covers are."""

    joined: UInt8Array
    """Which neighbours are one surface."""
    rank: UInt8Array
    """SENSOR / OBJECT ranks of source pixels that are not there, else 0."""
    crack_rank: Whole
    """What an unbroken quad over an empty pixel means."""


class Holes(NamedTuple):
    """The empty pixels of a target."""

    hole: BoolArray
    """H x W."""
    counted: NDArray[np.integer]
    """Their summed-area table (`chunks.marked_within`)."""
    rank: UInt8Array
    """H x W, the highest rank found so far."""


@kernel
def mark_closed_mesh(
    first: Whole, last: Whole, vertices: Vertices, mesh: ClosedMesh, boxes: NDArray[np.int32], out: Holes
) -> None:
    """Draw the whole closed grid over the empty pixels of target rows [first, last). vertices: without gaps."""
    columns = out.hole.shape[1]
    for row in range(mesh.joined.shape[0] - 1):
        for chunk in range(vertices.spans.shape[1]):
            if not chunk_meets(vertices.spans, row, chunk, first, last):
                continue
            room = boxes[first]
            for n in range(chunk_boxes(vertices, row, chunk, first, last, columns, room)):
                box = box_at(room, n)
                if (
                    box[0] <= box[1]
                    and box[2] <= box[3]
                    and marked_within(out.counted, box[0], box[1], box[2], box[3]) > 0
                ):
                    mark_quad(vertices, mesh, row, chunk * CHUNK + n, box, out)


@piece
def mark_quad(vertices: Vertices, mesh: ClosedMesh, row: Whole, column: Whole, box: Box, out: Holes) -> None:
    """One quad of the closed mesh, if all of it is in front of the near plane.

    Its rank: the highest of its pixels' own; else a crack where it is one surface; else a dis-occlusion.
    """
    w, grid_rank = vertices.w, mesh.rank
    wa, wb, wc, wd = w[row, column], w[row, column + 1], w[row + 1, column], w[row + 1, column + 1]
    if min(min(wa, wb), min(wc, wd)) <= 0:
        return
    rank = max(
        max(grid_rank[row, column], grid_rank[row, column + 1]),
        max(grid_rank[row + 1, column], grid_rank[row + 1, column + 1]),
    )
    if rank == 0:
        rank = mesh.crack_rank if quad_sides(mesh.joined, row, column) == 15 else DISOCCLUDED_RANK
    for ty in range(box[2], box[3] + 1):
        for tx in range(box[0], box[1] + 1):
            if out.hole[ty, tx] and out.rank[ty, tx] < rank and quad_covers(vertices, row, column, tx + 0.5, ty + 0.5):
                out.rank[ty, tx] = rank


@piece
def quad_covers(vertices: Vertices, row: Whole, column: Whole, px: Real, py: Real) -> Flag:
    """True if a point lies in one of a quad's two triangles."""
    x, y = vertices.x, vertices.y
    a, b = (x[row, column], y[row, column]), (x[row, column + 1], y[row, column + 1])
    c, d = (x[row + 1, column], y[row + 1, column]), (x[row + 1, column + 1], y[row + 1, column + 1])
    return is_inside(a, b, c, px, py) or is_inside(b, d, c, px, py)


def mark_points(vertices: Vertices, chosen: BoolArray, rank: int, out: Holes) -> None:
    """Raise the rank at the nearest target pixel of each chosen source pixel, where that is a hole. (numpy: they are few.)"""
    hole, ranks = out.hole, out.rank
    there = np.flatnonzero(chosen & (vertices.w > 0))
    px, py = vertices.x.ravel()[there], vertices.y.ravel()[there]
    inside = (px >= 0) & (py >= 0) & (px < hole.shape[1]) & (py < hole.shape[0])
    tx, ty = px[inside].astype(np.int64), py[inside].astype(np.int64)
    tx, ty = tx[hole[ty, tx]], ty[hole[ty, tx]]
    ranks[ty, tx] = np.maximum(ranks[ty, tx], np.uint8(rank))
