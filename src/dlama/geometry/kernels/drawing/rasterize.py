"""Numba kernels of rendering: source pixel grid in, z-buffers over target pixels out. Loaded only when something renders.

A source picture is a grid of vertices, one per pixel centre. `w` is inverse depth (1/m): it is affine in pixels on a
plane, both in the source and in the target, so all interpolation is done on it. Bands of rows are independent of each other,
which makes the result independent of the number of threads.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.drawing.chunks import (
    CHUNK,
    Box,
    box_at,
    chunk_boxes,
    chunk_meets,
    marked_within,
    quad_span,
    span_chunks,
)
from dlama.geometry.kernels.jit import Real, Whole, inlined, kernel, piece
from dlama.geometry.rgbd import Float32Array, UInt8Array

HALF_WORD, LARGEST = np.uint64(32), np.uint64(2**32 - 1)
"""Bits of each half of a point (`as_point`), and the largest number that fits."""


@piece
def transform_row(
    depth: Float32Array,
    matrix: Float64Array,
    offset: Float64Array,
    near: Real,
    row: Whole,
    to: Whole,
    out_x: Float32Array,
    out_y: Float32Array,
    out_w: Float32Array,
) -> None:
    """One row of vertices (pixel centres at their depth), to row `to` of the arrays of target pixels and inverse z."""
    v = row + 0.5
    a = matrix[0, 1] * v + matrix[0, 2]
    b = matrix[1, 1] * v + matrix[1, 2]
    c = matrix[2, 1] * v + matrix[2, 2]
    for column in range(depth.shape[1]):
        z = depth[row, column]
        u = column + 0.5
        ahead = z * (matrix[2, 0] * u + c) + offset[2]
        seen = 0 < z < np.inf and ahead > near
        inverse = 1.0 / ahead
        out_x[to, column] = (z * (matrix[0, 0] * u + a) + offset[0]) * inverse
        out_y[to, column] = (z * (matrix[1, 0] * u + b) + offset[1]) * inverse
        out_w[to, column] = inverse if seen else 0.0


@kernel
def transform(
    first: Whole,
    last: Whole,
    depth: Float32Array,
    matrix: Float64Array,
    offset: Float64Array,
    near: Real,
    out_x: Float32Array,
    out_y: Float32Array,
    out_w: Float32Array,
    spans: Float32Array,
) -> None:
    """Vertices into target pixels and inverse z; w = 0 (and x, y anything) where there is none, or none in front.

    matrix: 3x3, K_target R K_source^-1; offset: K_target t. (eq. 1 of the paper, with both projections folded in) spans: of the
    rows, as of `chunks.span_chunks`.
    """
    for row in range(first, last):
        transform_row(depth, matrix, offset, near, row, row, out_x, out_y, out_w)
        span_chunks(out_y, out_w, row, spans)


@kernel
def draw_points(
    first: Whole,
    last: Whole,
    depth: Float32Array,
    matrix: Float64Array,
    offset: Float64Array,
    near: Real,
    x: Float32Array,
    y: Float32Array,
    w: Float32Array,
    place: NDArray[np.int32],
    nearest: NDArray[np.uint64],
    columns: Whole,
) -> None:
    """Nearest-pixel projection with a z-buffer (the paper's P', eq. 2): what is nearest in each target pixel, as `as_point`.

    nearest: H W zeros; columns: W. x, y, w: 1 x width, place: width: room for a row of source pixels. All source rows are one
    band, for they share a z-buffer: those of several bands take longer to allocate than points to draw.
    """
    rows = len(nearest) // columns
    for row in range(first, last):
        transform_row(depth, matrix, offset, near, row, 0, x, y, w)
        for column in range(depth.shape[1]):
            px, py = x[0, column], y[0, column]
            inside = (w[0, column] > 0) & (px >= 0) & (py >= 0) & (px < columns) & (py < rows)
            place[column] = np.int32(py) * np.int32(columns) + np.int32(px) if inside else np.int32(-1)
        for column in range(depth.shape[1]):
            if place[column] >= 0:
                at = np.uint64(place[column])
                nearest[at] = max(nearest[at], as_point(w[0, column], row * depth.shape[1] + column))


@piece
def as_point(inverse: Real, index: Whole) -> np.uint64:
    """Inverse depth (float32, > 0) and source index as one number: larger where nearer, or as near and earlier."""
    return (np.uint64(np.float32(inverse).view(np.uint32)) << HALF_WORD) | (LARGEST - np.uint64(index))


@piece
def inverse_of(point: np.uint64) -> np.float32:
    """Inverse depth of a point (`as_point`); 0 where there is none."""
    return np.uint32(point >> HALF_WORD).view(np.float32)


@piece
def index_of(point: np.uint64) -> np.uint64:
    """Source index of a point (`as_point`)."""
    return LARGEST - (point & LARGEST)


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
    x: Float32Array,
    y: Float32Array,
    w: Float32Array,
    joined: UInt8Array,
    spans: Float32Array,
    count: NDArray[np.integer],
    boxes: NDArray[np.int32],
    wbuf: Float32Array,
    where: Float32Array,
) -> None:
    """The joined quads of the grid into target rows [first, last), z-buffered.

    count: summed-area table of the target pixels that count (`marked_within`), all others may come out as anything; without rows:
    all count. wbuf: H x W float32 zeros; where: H x W x 2 source column, row.
    """
    height, width = x.shape
    columns, some = wbuf.shape[1], len(count) > 0
    for row in range(height - 1):
        for chunk in range(spans.shape[1]):
            low, high = quad_span(spans, row, chunk)
            if (
                high < first
                or low > last
                or (some and not chunk_meets(x, w, row, chunk, low, high, first, last, count))
            ):
                continue
            begin, end, room = chunk * CHUNK, min(width - 1, (chunk + 1) * CHUNK), boxes[first]
            chunk_boxes(x, y, w, row, begin, end, first, last, columns, room)
            for n in range(end - begin):
                if room[0, n] > room[1, n] or room[2, n] > room[3, n]:
                    continue
                sides, box = quad_sides(joined, row, begin + n), box_at(room, n)
                if sides == 0:
                    continue
                if not some or marked_within(count, box[0], box[1], box[2], box[3]) > 0:
                    draw_quad(x, y, w, row, begin + n, sides, box, wbuf, where)


@inlined
def draw_quad(
    x: Float32Array,
    y: Float32Array,
    w: Float32Array,
    row: Whole,
    column: Whole,
    sides: Whole,
    box: Box,
    wbuf: Float32Array,
    where: Float32Array,
) -> None:
    """One quad: two triangles where all four sides are joined, else the triangle of the corner whose two sides are.

    box: the target pixels to look at (left, right, upper, lower, inclusive).
    """
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
                if inverse > wbuf[at_row, at_column]:
                    wbuf[at_row, at_column] = inverse
                    across = (v0 if from_b else 0.0) + v1 + (v2 if to_d else 0.0)
                    down = (v1 if over_d else 0.0) + v2
                    where[at_row, at_column, 0] = column + across / inverse
                    where[at_row, at_column, 1] = row + down / inverse
