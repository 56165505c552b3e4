"""Numba kernels that turn z-buffers into pictures: source positions in; colour, depth, origin, confidence out."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from dlama.geometry.raster import quad_sides

REPROJECTED = 2
MEASURED = 1


@njit(cache=True)
def passed_on(origin):
    """The origin of a pixel seen in another view: measured becomes reprojected, everything else stays what it is."""
    return REPROJECTED if origin == MEASURED else origin


@njit(cache=True, parallel=True)
def shade_surface(wbuf, where, joined, color, origin, confidence, out_color, out_depth, out_origin, out_confidence):
    """Colours of a surface drawing: bilinear between joined source pixels, never across an edge.

    wbuf: H x W inverse depth, 0 = empty; where: H x W x 2 source column, row (vertex positions, so 0 is the first pixel).
    """
    rows, columns = wbuf.shape
    height, width = joined.shape
    for ty in prange(rows):
        weights = np.empty(4, np.float64)
        for tx in range(columns):
            w = wbuf[ty, tx]
            if w <= 0:
                continue
            out_depth[ty, tx] = 1.0 / w
            su, sv = where[ty, tx, 0], where[ty, tx, 1]
            left, upper = int(su), int(sv)
            fu, fv = su - left, sv - upper
            nearest_row, nearest_column = upper + (fv > 0.5), left + (fu > 0.5)
            out_origin[ty, tx] = passed_on(origin[nearest_row, nearest_column])
            out_confidence[ty, tx] = confidence[nearest_row, nearest_column]
            if (fu < 1e-3 and fv < 1e-3) or left >= width - 1 or upper >= height - 1:
                for channel in range(3):
                    out_color[ty, tx, channel] = color[nearest_row, nearest_column, channel]
                continue
            corner_weights(quad_sides(joined, upper, left), fu, fv, weights)
            for channel in range(3):
                value = (
                    weights[0] * color[upper, left, channel]
                    + weights[1] * color[upper, left + 1, channel]
                    + weights[2] * color[upper + 1, left, channel]
                    + weights[3] * color[upper + 1, left + 1, channel]
                )
                out_color[ty, tx, channel] = np.uint8(value + 0.5)


@njit(cache=True)
def corner_weights(sides, fu, fv, weights):
    """Bilinear weights of a quad's corners; a corner that is cut off (two sides unjoined) counts nothing."""
    weights[0] = (1 - fu) * (1 - fv) if sides & 3 else 0.0
    weights[1] = fu * (1 - fv) if sides & 5 else 0.0
    weights[2] = (1 - fu) * fv if sides & 10 else 0.0
    weights[3] = fu * fv if sides & 12 else 0.0
    total = weights[0] + weights[1] + weights[2] + weights[3]
    if total <= 1e-6:
        weights[:] = 0
        weights[2 * int(fv > 0.5) + int(fu > 0.5)] = 1
        return
    weights /= total


@njit(cache=True, parallel=True)
def shade_points(wbuf, index, color, origin, confidence, out_color, out_depth, out_origin, out_confidence):
    """Colours of a points drawing: each pixel shows its nearest point as it is. index: -1 = empty."""
    rows, columns = wbuf.shape
    width = color.shape[1]
    for ty in prange(rows):
        for tx in range(columns):
            source = index[ty, tx]
            if source < 0:
                continue
            row, column = source // width, source % width
            out_depth[ty, tx] = 1.0 / wbuf[ty, tx]
            out_color[ty, tx, 0] = color[row, column, 0]
            out_color[ty, tx, 1] = color[row, column, 1]
            out_color[ty, tx, 2] = color[row, column, 2]
            out_origin[ty, tx] = passed_on(origin[row, column])
            out_confidence[ty, tx] = confidence[row, column]


@njit(cache=True)
def shade_far(matrix, far, color, origin, confidence, out_color, out_depth, out_origin, out_confidence):
    """The far layer behind everything: empty target pixels (depth 0) whose direction is far in the source.

    matrix: 3x3, K_source R K_target^-1 (rotation alone: what is far does not shift when the camera moves).
    Bilinear where all four source pixels are far, the nearest pixel else.
    """
    rows, columns = out_depth.shape
    height, width = far.shape
    for ty in range(rows):
        y = ty + 0.5
        for tx in range(columns):
            if out_depth[ty, tx] != 0:
                continue
            x = tx + 0.5
            ahead = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2]
            if ahead <= 1e-9:
                continue
            su = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2]) / ahead
            sv = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2]) / ahead
            if not (0 <= su < width and 0 <= sv < height):
                continue
            column, row = int(su), int(sv)
            if not far[row, column]:
                continue
            out_depth[ty, tx] = np.inf
            out_origin[ty, tx] = passed_on(origin[row, column])
            out_confidence[ty, tx] = confidence[row, column]
            left, upper = int(math.floor(su - 0.5)), int(math.floor(sv - 0.5))
            inside = 0 <= left < width - 1 and 0 <= upper < height - 1
            if (
                inside
                and far[upper, left]
                and far[upper, left + 1]
                and far[upper + 1, left]
                and far[upper + 1, left + 1]
            ):
                fu, fv = su - 0.5 - left, sv - 0.5 - upper
                for channel in range(3):
                    value = (
                        (1 - fu) * (1 - fv) * color[upper, left, channel]
                        + fu * (1 - fv) * color[upper, left + 1, channel]
                        + (1 - fu) * fv * color[upper + 1, left, channel]
                        + fu * fv * color[upper + 1, left + 1, channel]
                    )
                    out_color[ty, tx, channel] = np.uint8(value + 0.5)
            else:
                for channel in range(3):
                    out_color[ty, tx, channel] = color[row, column, channel]
