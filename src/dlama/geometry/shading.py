"""Numba kernels that turn z-buffers into pictures: source positions in; colour, depth, origin, confidence out."""

from __future__ import annotations

import math

import numpy as np

from dlama.geometry.compiling import kernel, piece
from dlama.geometry.raster import quad_sides

REPROJECTED = 2
MEASURED = 1


@piece
def passed_on(origin):
    """The origin of a pixel seen in another view: measured becomes reprojected, everything else stays what it is."""
    return REPROJECTED if origin == MEASURED else origin


@kernel
def shade_surface(
    first, last, wbuf, where, joined, color, origin, confidence, out_color, out_depth, out_origin, out_confidence
):
    """Colours of a surface drawing: bilinear between joined source pixels, never across an edge.

    wbuf: H x W inverse depth, 0 = empty; where: H x W x 2 source column, row (vertex positions, so 0 is the first pixel).
    """
    height, width = joined.shape
    for ty in range(first, last):
        for tx in range(wbuf.shape[1]):
            w = wbuf[ty, tx]
            if w <= 0:
                continue
            out_depth[ty, tx] = 1.0 / w
            su, sv = where[ty, tx, 0], where[ty, tx, 1]
            left, upper = int(su), int(sv)
            fu, fv = su - left, sv - upper
            right, lower = fu > 0.5, fv > 0.5
            nearest_row, nearest_column = upper + lower, left + right
            out_origin[ty, tx] = passed_on(origin[nearest_row, nearest_column])
            out_confidence[ty, tx] = confidence[nearest_row, nearest_column]
            if (fu < 1e-3 and fv < 1e-3) or left >= width - 1 or upper >= height - 1:
                for channel in range(3):
                    out_color[ty, tx, channel] = color[nearest_row, nearest_column, channel]
                continue
            # bilinear weights; a corner that is cut off (two sides unjoined) counts nothing
            sides = quad_sides(joined, upper, left)
            a = (1 - fu) * (1 - fv) if sides & 3 else 0.0
            b = fu * (1 - fv) if sides & 5 else 0.0
            c = (1 - fu) * fv if sides & 10 else 0.0
            d = fu * fv if sides & 12 else 0.0
            total = a + b + c + d
            if total <= 1e-6:
                a, b, c, d = 0.0, 0.0, 0.0, 0.0
                if lower:
                    c, d, total = 1.0 - right, 1.0 * right, 1.0
                else:
                    a, b, total = 1.0 - right, 1.0 * right, 1.0
            a, b, c, d = a / total, b / total, c / total, d / total
            for channel in range(3):
                value = (
                    a * color[upper, left, channel]
                    + b * color[upper, left + 1, channel]
                    + c * color[upper + 1, left, channel]
                    + d * color[upper + 1, left + 1, channel]
                )
                out_color[ty, tx, channel] = np.uint8(value + 0.5)


@kernel
def shade_points(first, last, wbuf, index, color, origin, confidence, out_color, out_depth, out_origin, out_confidence):
    """Colours of a points drawing: each pixel shows its nearest point as it is.

    wbuf, index: N x H x W, parts of one drawing, which are merged into the first; of two equally near the earlier part's is
    seen. index: uint32. color: pixels x 3, origin, confidence: pixels, as `index` counts them.
    """
    parts, _, columns = wbuf.shape
    for ty in range(first, last):
        for part in range(1, parts):
            for tx in range(columns):
                nearer = wbuf[part, ty, tx] > wbuf[0, ty, tx]
                index[0, ty, tx] = index[part, ty, tx] if nearer else index[0, ty, tx]
                wbuf[0, ty, tx] = wbuf[part, ty, tx] if nearer else wbuf[0, ty, tx]
        for tx in range(columns):
            w = wbuf[0, ty, tx]
            out_depth[ty, tx] = np.float32(1) / w if w > 0 else np.float32(0)
        for tx in range(columns):
            if wbuf[0, ty, tx] > 0:
                source = index[0, ty, tx]
                out_color[ty, tx, 0] = color[source, 0]
                out_color[ty, tx, 1] = color[source, 1]
                out_color[ty, tx, 2] = color[source, 2]
                out_origin[ty, tx] = passed_on(origin[source])
                out_confidence[ty, tx] = confidence[source]


@kernel
def shade_far(
    first, last, matrix, far, box, color, origin, confidence, out_color, out_depth, out_origin, out_confidence
):
    """The far layer behind everything: empty target pixels (depth 0) whose direction is far in the source.

    matrix: 3x3, K_source R K_target^-1 (rotation alone: what is far does not shift when the camera moves).
    far: H x W bool; box: left, right, upper, lower (inclusive) of its True pixels, to tell most others without a division.
    Bilinear where all four source pixels are far, the nearest pixel else.
    """
    height, width = far.shape
    left_end, right_end, upper_end, lower_end = box[0] - 1.0, box[1] + 2.0, box[2] - 1.0, box[3] + 2.0
    for ty in range(first, last):
        y = ty + 0.5
        for tx in range(out_depth.shape[1]):
            if out_depth[ty, tx] != 0:
                continue
            x = tx + 0.5
            ahead = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2]
            if ahead <= 1e-9:
                continue
            across = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2]
            along = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2]
            if not (left_end * ahead < across < right_end * ahead and upper_end * ahead < along < lower_end * ahead):
                continue
            su, sv = across / ahead, along / ahead
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
