"""Numba kernels of rendering: source pixel grid in, z-buffers over target pixels out. Loaded only when something renders.

A source picture is a grid of vertices, one per pixel centre. `w` is inverse depth (1/m): it is affine in pixels on a
plane, both in the source and in the target, so all interpolation is done on it. Bands of rows are independent of each other,
which makes the result independent of the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.drawing.chunks import (
    CHUNK,
    Box,
    Vertices,
    box_at,
    chunk_boxes,
    chunk_meets,
    marked_within,
    span_chunks,
)
from dlama.geometry.kernels.jit import Whole, inlined, kernel, piece
from dlama.geometry.projection import PixelMap
from dlama.geometry.rgbd import Float32Array, UInt8Array

NEAR = 1e-3
"""Near plane in metres."""
HALF_WORD, LARGEST = np.uint64(32), np.uint64(2**32 - 1)
"""Bits of each half of a point of `drop_points`, and the largest number that fits."""


class ZBuffer(NamedTuple):
    """The nearest surface in each target pixel."""

    w: Float32Array
    """H x W, inverse depth; 0 = empty."""
    where: Float32Array
    """H x W x 2, source column and row (vertex positions, so 0 is the first pixel)."""


@kernel
def transform(first: Whole, last: Whole, depth: Float32Array, way: PixelMap, out: Vertices) -> None:
    """Vertices (pixel centres at their depth) into target pixels and inverse z (eq. 1 of the paper)."""
    matrix, offset = way.matrix, way.offset
    for row in range(first, last):
        v = row + 0.5
        a = matrix[0, 1] * v + matrix[0, 2]
        b = matrix[1, 1] * v + matrix[1, 2]
        c = matrix[2, 1] * v + matrix[2, 2]
        for column in range(depth.shape[1]):
            z = depth[row, column]
            u = column + 0.5
            ahead = z * (matrix[2, 0] * u + c) + offset[2]
            seen = 0 < z < np.inf and ahead > NEAR
            inverse = 1.0 / ahead
            out.x[row, column] = (z * (matrix[0, 0] * u + a) + offset[0]) * inverse
            out.y[row, column] = (z * (matrix[1, 0] * u + b) + offset[1]) * inverse
            out.w[row, column] = inverse if seen else 0.0
        span_chunks(out, row)


@kernel
def drop_points(
    first: Whole,
    last: Whole,
    x: np.ndarray,
    y: np.ndarray,
    w: Float32Array,
    columns: Whole,
    nearest: NDArray[np.uint64],
) -> None:
    """Points onto the pixel that each falls on, where it is the nearest (the paper's P', eq. 2).

    x, y: N px; w: N inverse depths (1/m), 0 = nothing, or not in front: x and y may be anything there. columns: W.
    nearest: H W zeros; inverse depth and number of a point as one number, larger where nearer, or as near and earlier. All points
    are one band, for they share a z-buffer: those of several bands take longer to allocate than points to draw.
    """
    rows = len(nearest) // columns
    for point in range(first, last):
        px, py = x[point], y[point]
        if (w[point] > 0) & (px >= 0) & (py >= 0) & (px < columns) & (py < rows):
            at = np.int64(py) * columns + np.int64(px)
            key = (np.uint64(np.float32(w[point]).view(np.uint32)) << HALF_WORD) | (LARGEST - np.uint64(point))
            nearest[at] = max(nearest[at], key)


@piece
def quad_sides(joined: UInt8Array, row: Whole, column: Whole) -> Whole:
    """The four sides of the quad at (row, column), as bits: 1 top, 2 left, 4 right, 8 bottom."""
    here = joined[row, column]
    sides = (here & RIGHT) | (here & DOWN)
    sides |= (joined[row, column + 1] & DOWN) << 1
    sides |= (joined[row + 1, column] & RIGHT) << 3
    return sides


@kernel
def draw_surface(
    first: Whole,
    last: Whole,
    vertices: Vertices,
    joined: UInt8Array,
    count: NDArray[np.integer],
    boxes: NDArray[np.int32],
    out: ZBuffer,
) -> None:
    """The joined quads of the grid into target rows [first, last), z-buffered.

    count: summed-area table of the target pixels that count (`marked_within`), all others may come out as anything; without rows:
    all count. out: w is 0 at first.
    """
    columns, some = out.w.shape[1], len(count) > 0
    for row in range(joined.shape[0] - 1):
        for chunk in range(vertices.spans.shape[1]):
            if not chunk_meets(vertices.spans, row, chunk, first, last):
                continue
            room = boxes[first]
            for n in range(chunk_boxes(vertices, row, chunk, first, last, columns, room)):
                if room[0, n] > room[1, n] or room[2, n] > room[3, n]:
                    continue
                column = chunk * CHUNK + n
                sides, box = quad_sides(joined, row, column), box_at(room, n)
                if sides == 0:
                    continue
                if not some or marked_within(count, box[0], box[1], box[2], box[3]) > 0:
                    draw_quad(vertices, row, column, sides, box, out)


@inlined
def draw_quad(vertices: Vertices, row: Whole, column: Whole, sides: Whole, box: Box, out: ZBuffer) -> None:
    """One quad: two triangles where all four sides are joined, else the triangle of the corner whose two sides are.

    box: the target pixels to look at (left, right, upper, lower, inclusive).
    """
    x, y, w = vertices.x, vertices.y, vertices.w
    # unsigned places are not checked for being negative
    upper, lower, left, right = np.uintp(row), np.uintp(row + 1), np.uintp(column), np.uintp(column + 1)
    wa, wb, wc, wd = w[upper, left], w[upper, right], w[lower, left], w[lower, right]
    xa, xb, xc, xd = x[upper, left], x[upper, right], x[lower, left], x[lower, right]
    ya, yb, yc, yd = y[upper, left], y[upper, right], y[lower, left], y[lower, right]
    along_bc = abs(wb - wc) <= abs(wa - wd)
    whole = sides == 15
    begin = 2 if whole and not along_bc else 0
    for number in range(begin, begin + 2 if whole else 4):
        # upper left, lower right (cut along bc), upper right, lower left (along ad), and the sides they need: the triangles
        # abc, bdc, abd, adc
        needed = (3 if number == 0 else 12) if number < 2 else (5 if number == 2 else 10)
        if sides & needed != needed:
            continue
        from_b, over_d, to_d = number == 1, number & 1, number == 2
        x0, y0, w0 = (xb, yb, wb) if from_b else (xa, ya, wa)
        x1, y1, w1 = (xd, yd, wd) if over_d else (xb, yb, wb)
        x2, y2, w2 = (xd, yd, wd) if to_d else (xc, yc, wc)
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if area <= 1e-9 or w0 <= 0 or w1 <= 0 or w2 <= 0:  # seen from behind, or not all there
            continue
        outside, scale = -1.01e-4 * area, 0.0  # most pixels of the box are clearly outside: no division for them
        for ty in range(box[2], box[3] + 1):
            py = ty + 0.5
            for tx in range(box[0], box[1] + 1):
                px = tx + 0.5
                e1 = (px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)
                e2 = (x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)
                if e1 < outside or e2 < outside or area - e1 - e2 < outside:
                    continue
                if scale == 0.0:
                    scale = 1.0 / area
                b1, b2 = e1 * scale, e2 * scale
                b0 = 1.0 - b1 - b2
                if b0 < -1e-4 or b1 < -1e-4 or b2 < -1e-4:
                    continue
                v0, v1, v2 = b0 * w0, b1 * w1, b2 * w2
                inverse = v0 + v1 + v2
                at_row, at_column = np.uintp(ty), np.uintp(tx)
                if inverse > out.w[at_row, at_column]:
                    out.w[at_row, at_column] = inverse
                    across = (v0 if from_b else 0.0) + v1 + (v2 if to_d else 0.0)
                    down = (v1 if over_d else 0.0) + v2
                    out.where[at_row, at_column, 0] = column + across / inverse
                    out.where[at_row, at_column, 1] = row + down / inverse
