"""Numba kernels of rendering: source pixel grid in, z-buffers over target pixels out. Loaded only when something renders.

A source picture is a grid of vertices, one per pixel centre. `w` is inverse depth (1/m): it is affine in pixels on a
plane, both in the source and in the target, so all interpolation is done on it. Bands of target rows are independent,
which makes every kernel parallel and its result independent of the number of threads.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

RIGHT = 1
DOWN = 2
BAND = 32
"""Target rows per parallel task."""
CHUNK = 64
"""Source columns that are skipped together where they do not touch a band."""


@njit(cache=True)
def slope_goes_on(w0, w1, behind, behind2, ahead, ahead2):
    """True if the steep step w0 -> w1 continues a slope: an inclined plane is affine in inverse depth, an edge is not.

    One neighbouring slope is not enough (a single mixed pixel makes two equal steps), two on one side or one on each are.
    """
    step = w1 - w0
    tolerance = 0.2 * abs(step)
    before = behind > 0 and abs(w0 - behind - step) <= tolerance
    after = ahead > 0 and abs(ahead - w1 - step) <= tolerance
    if before and after:
        return True
    if before and behind2 > 0 and abs(behind - behind2 - step) <= tolerance:
        return True
    return after and ahead2 > 0 and abs(ahead2 - ahead - step) <= tolerance


@njit(cache=True)
def at(w, row, column):
    """w at a pixel, 0 (no vertex) outside the picture."""
    if 0 <= row < w.shape[0] and 0 <= column < w.shape[1]:
        return w[row, column]
    return np.float32(0)


@njit(cache=True)
def is_slope(w, row, column, dr, dc):
    """True if the steep step from (row, column) to (row + dr, column + dc) continues a slope."""
    w0, w1 = w[row, column], w[row + dr, column + dc]
    if w0 <= 0 or w1 <= 0:
        return False
    return slope_goes_on(
        w0,
        w1,
        at(w, row - dr, column - dc),
        at(w, row - 2 * dr, column - 2 * dc),
        at(w, row + 2 * dr, column + 2 * dc),
        at(w, row + 3 * dr, column + 3 * dc),
    )


@njit(cache=True)
def joints(w, ratio):
    """uint8 H x W: bit RIGHT / DOWN set where a vertex is joined to its right / lower neighbour. w: 0 = no vertex."""
    height, width = w.shape
    out = np.zeros((height, width), np.uint8)
    for row in range(height):
        for column in range(width):
            if w[row, column] <= 0:
                continue
            here = w[row, column]
            flags = 0
            if column + 1 < width:
                other = w[row, column + 1]
                if abs(other - here) <= ratio * max(other, here) or is_slope(w, row, column, 0, 1):
                    flags |= RIGHT
            if row + 1 < height:
                other = w[row + 1, column]
                if abs(other - here) <= ratio * max(other, here) or is_slope(w, row, column, 1, 0):
                    flags |= DOWN
            out[row, column] = flags
    return out


@njit(cache=True)
def flying_pixels(w, ratio):
    """bool H x W: vertices strictly between two surfaces along a row or a column, joined to neither."""
    height, width = w.shape
    out = np.zeros((height, width), np.bool_)
    for row in range(height):
        for column in range(width):
            here = w[row, column]
            if here <= 0:
                continue
            if 0 < column < width - 1 and lies_between(here, w[row, column - 1], w[row, column + 1], ratio):
                out[row, column] = not (is_slope(w, row, column - 1, 0, 1) or is_slope(w, row, column, 0, 1))
            if 0 < row < height - 1 and lies_between(here, w[row - 1, column], w[row + 1, column], ratio):
                out[row, column] |= not (is_slope(w, row - 1, column, 1, 0) or is_slope(w, row, column, 1, 0))
    return out


@njit(cache=True)
def lies_between(here, one, other, ratio):
    """True if `here` is between both neighbours, and further from each than surfaces are joined over."""
    low, high = min(one, other), max(one, other)
    return 0 < low < here * (1 - ratio) and here < high * (1 - ratio)


@njit(cache=True, parallel=True)
def transform(depth, matrix, offset, near, out_x, out_y, out_w):
    """Vertices (pixel centres at their depth) into target pixels and inverse z; 0 where there is none, or none in front.

    matrix: 3x3, K_target R K_source^-1; offset: K_target t. (eq. 1 of the paper, with both projections folded in)
    """
    height, width = depth.shape
    for row in prange(height):
        v = row + 0.5
        a = matrix[0, 1] * v + matrix[0, 2]
        b = matrix[1, 1] * v + matrix[1, 2]
        c = matrix[2, 1] * v + matrix[2, 2]
        for column in range(width):
            z = depth[row, column]
            out_w[row, column] = 0
            if not 0 < z < np.inf:
                continue
            u = column + 0.5
            ahead = z * (matrix[2, 0] * u + c) + offset[2]
            if ahead <= near:
                continue
            inverse = 1.0 / ahead
            out_x[row, column] = (z * (matrix[0, 0] * u + a) + offset[0]) * inverse
            out_y[row, column] = (z * (matrix[1, 0] * u + b) + offset[1]) * inverse
            out_w[row, column] = inverse


@njit(cache=True)
def quad_spans(y, w):
    """Smallest and largest target y of each row of quads, CHUNK quads at a time (empty: inf, -inf)."""
    height, width = y.shape
    chunks = (width + CHUNK - 1) // CHUNK
    spans = np.empty((height, chunks, 2), np.float32)
    for row in range(height):
        for chunk in range(chunks):
            low, high = np.float32(np.inf), np.float32(-np.inf)
            for r in range(row, min(height, row + 2)):
                for column in range(chunk * CHUNK, min(width, (chunk + 1) * CHUNK + 1)):
                    if w[r, column] > 0:
                        low = min(low, y[r, column])
                        high = max(high, y[r, column])
            spans[row, chunk, 0], spans[row, chunk, 1] = low, high
    return spans


@njit(cache=True)
def fill_triangle(x0, y0, w0, x1, y1, w1, x2, y2, w2, corners, row, column, box, wbuf, where):
    """Front-facing triangle into the z-buffer: inverse depth, and the source position that is seen.

    corners: the quad corners (bit 0: right, bit 1: lower) of the three vertices, packed two bits each; box: the target
    pixels to look at (left, right, upper, lower, inclusive).
    """
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if area <= 1e-9 or w0 <= 0 or w1 <= 0 or w2 <= 0:
        return
    scale = 1.0 / area
    for ty in range(box[2], box[3] + 1):
        py = ty + 0.5
        for tx in range(box[0], box[1] + 1):
            px = tx + 0.5
            b1 = ((px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)) * scale
            b2 = ((x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)) * scale
            b0 = 1.0 - b1 - b2
            if b0 < -1e-4 or b1 < -1e-4 or b2 < -1e-4:
                continue
            v0, v1, v2 = b0 * w0, b1 * w1, b2 * w2
            w = v0 + v1 + v2
            if w > wbuf[ty, tx]:
                wbuf[ty, tx] = w
                right = v0 * (corners & 1) + v1 * (corners >> 2 & 1) + v2 * (corners >> 4 & 1)
                lower = v0 * (corners >> 1 & 1) + v1 * (corners >> 3 & 1) + v2 * (corners >> 5 & 1)
                where[ty, tx, 0] = column + right / w
                where[ty, tx, 1] = row + lower / w


@njit(cache=True)
def quad_box(x, y, w, row, column, top, bottom, columns):
    """Target pixels whose centres a quad may cover, cut to rows [top, bottom): left, right, upper, lower, inclusive.

    Vertices that are not there (w = 0) have no position and do not count.
    """
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for r in range(row, row + 2):
        for c in range(column, column + 2):
            if w[r, c] > 0:
                px, py = x[r, c], y[r, c]
                low_x, high_x = min(low_x, px), max(high_x, px)
                low_y, high_y = min(low_y, py), max(high_y, py)
    if not low_x <= high_x:
        return 0, -1, 0, -1
    left = math.ceil(max(0.5, low_x) - 0.5001)
    right = math.floor(min(columns - 0.5, high_x) - 0.4999)
    upper = math.ceil(max(top + 0.5, low_y) - 0.5001)
    lower = math.floor(min(bottom - 0.5, high_y) - 0.4999)
    return int(left), int(right), int(upper), int(lower)


A, B, C, D = 0, 1, 2, 3  # corners of a quad: upper left, upper right, lower left, lower right
ABC = A | B << 2 | C << 4
BDC = B | D << 2 | C << 4
ABD = A | B << 2 | D << 4
ADC = A | D << 2 | C << 4


@njit(cache=True)
def quad_sides(joined, row, column):
    """The four sides of the quad at (row, column), as bits: 1 top, 2 left, 4 right, 8 bottom."""
    here = joined[row, column]
    sides = (here & RIGHT) | (here & DOWN)
    sides |= (joined[row, column + 1] & DOWN) << 1
    sides |= (joined[row + 1, column] & RIGHT) << 3
    return sides


@njit(cache=True, parallel=True)
def draw_surface(x, y, w, joined, wbuf, where):
    """The joined quads of the grid, z-buffered. wbuf: H x W float32 zeros; where: H x W x 2 source column, row."""
    height, width = x.shape
    rows, columns = wbuf.shape
    spans = quad_spans(y, w)
    for band in prange((rows + BAND - 1) // BAND):
        top, bottom = band * BAND, min(rows, (band + 1) * BAND)
        for row in range(height - 1):
            for chunk in range(spans.shape[1]):
                if spans[row, chunk, 1] < top or spans[row, chunk, 0] > bottom:
                    continue
                for column in range(chunk * CHUNK, min(width - 1, (chunk + 1) * CHUNK)):
                    sides = quad_sides(joined, row, column)
                    if sides == 0:
                        continue
                    box = quad_box(x, y, w, row, column, top, bottom, columns)
                    if box[0] <= box[1] and box[2] <= box[3]:
                        draw_quad(x, y, w, row, column, sides, box, wbuf, where)


@njit(cache=True)
def draw_quad(x, y, w, row, column, sides, box, wbuf, where):
    """One quad: two triangles where all four sides are joined, else the triangle of the corner whose two sides are."""
    xa, xb, xc, xd = x[row, column], x[row, column + 1], x[row + 1, column], x[row + 1, column + 1]
    ya, yb, yc, yd = y[row, column], y[row, column + 1], y[row + 1, column], y[row + 1, column + 1]
    wa, wb, wc, wd = w[row, column], w[row, column + 1], w[row + 1, column], w[row + 1, column + 1]
    full = sides == 15
    along_bc = abs(wb - wc) <= abs(wa - wd)
    if (full and along_bc) or (not full and sides & 3 == 3):
        fill_triangle(xa, ya, wa, xb, yb, wb, xc, yc, wc, ABC, row, column, box, wbuf, where)
    if (full and along_bc) or (not full and sides & 12 == 12):
        fill_triangle(xb, yb, wb, xd, yd, wd, xc, yc, wc, BDC, row, column, box, wbuf, where)
    if (full and not along_bc) or (not full and sides & 5 == 5):
        fill_triangle(xa, ya, wa, xb, yb, wb, xd, yd, wd, ABD, row, column, box, wbuf, where)
    if (full and not along_bc) or (not full and sides & 10 == 10):
        fill_triangle(xa, ya, wa, xd, yd, wd, xc, yc, wc, ADC, row, column, box, wbuf, where)


@njit(cache=True)
def lean(x, y, w, joined, row, column):
    """How steep the surface round a vertex is (relative step in w to a joined neighbour), -1 if it is seen from behind."""
    height, width = joined.shape
    steepest, facing = 0.0, 0.0
    here = w[row, column]
    for dr, dc, side in ((0, 1, RIGHT), (1, 0, DOWN), (0, -1, RIGHT), (-1, 0, DOWN)):
        r, c = row + dr, column + dc
        if not (0 <= r < height and 0 <= c < width) or w[r, c] <= 0:
            continue
        if not joined[min(row, r), min(column, c)] & side:
            continue
        steepest = max(steepest, abs(w[r, c] / here - 1))
        # the neighbour a quarter turn on: right -> down -> left -> up
        r2, c2 = row + dc, column - dr
        if not (0 <= r2 < height and 0 <= c2 < width) or w[r2, c2] <= 0:
            continue
        if joined[min(row, r2), min(column, c2)] & (DOWN if side == RIGHT else RIGHT):
            facing += (x[r, c] - x[row, column]) * (y[r2, c2] - y[row, column])
            facing -= (x[r2, c2] - x[row, column]) * (y[r, c] - y[row, column])
    return -1.0 if facing < 0 else steepest


@njit(cache=True)
def draw_rim(x, y, w, joined, rim, depth, zoom, wbuf, where):
    """One-pixel footprints of the vertices at the rim of the mesh (wires, poles, silhouettes, isolated pixels).

    rim: N flat source indices; depth: source z; zoom: target focal length / source focal length. A footprint is the source
    pixel's own size, at least one target pixel and at most 32. It only covers what is empty, or behind the surface it
    belongs to.
    """
    width = x.shape[1]
    rows, columns = wbuf.shape
    meshed = wbuf.copy()
    for vertex in rim:
        row, column = vertex // width, vertex % width
        inverse, px, py = w[row, column], x[row, column], y[row, column]
        half = min(16.0, 0.5 * zoom * depth[row, column] * inverse)
        if not (inverse > 0 and -half - 1 < px < columns + half + 1 and -half - 1 < py < rows + half + 1):
            continue
        steepest = lean(x, y, w, joined, row, column)
        if steepest < 0:
            continue
        if half <= 0.5:
            left = right = int(math.floor(px))
            upper = lower = int(math.floor(py))
        else:
            left, right = int(math.ceil(px - half - 0.5)), int(math.ceil(px + half - 0.5)) - 1
            upper, lower = int(math.ceil(py - half - 0.5)), int(math.ceil(py + half - 0.5)) - 1
        for ty in range(max(0, upper), min(rows - 1, lower) + 1):
            for tx in range(max(0, left), min(columns - 1, right) + 1):
                if inverse > wbuf[ty, tx] and inverse > meshed[ty, tx] * (1.02 + 2 * steepest):
                    wbuf[ty, tx] = inverse
                    where[ty, tx, 0] = column
                    where[ty, tx, 1] = row


@njit(cache=True)
def draw_points(x, y, w, wbuf, index):
    """Nearest-pixel projection with a z-buffer (the paper's P', eq. 2): inverse depth and source index of what is nearest.

    One thread: neighbouring source pixels write neighbouring target pixels, so the caches do the work.
    """
    height, width = x.shape
    rows, columns = wbuf.shape
    for row in range(height):
        for column in range(width):
            inverse = w[row, column]
            px, py = x[row, column], y[row, column]
            if inverse > 0 and px >= 0 and py >= 0 and px < columns and py < rows:
                tx, ty = int(px), int(py)
                if inverse > wbuf[ty, tx]:
                    wbuf[ty, tx] = inverse
                    index[ty, tx] = row * width + column
