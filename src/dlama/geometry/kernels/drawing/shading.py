"""Numba kernels that turn z-buffers into pictures: source positions in; colour, depth, origin, confidence out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.codes import Origin
from dlama.geometry.kernels.drawing.rasterize import LARGEST, ZBuffer, quad_sides
from dlama.geometry.kernels.drawing.sampling import (
    HALF,
    ONE,
    ZERO,
    MeshColors,
    at_pixel,
    bilinear,
    level,
    smooth_color,
    surface_color,
)
from dlama.geometry.kernels.jit import Flag, Real, Whole, inlined, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

MEASURED, REPROJECTED = Origin.MEASURED.value, Origin.REPROJECTED.value
SHRUNK_2 = np.float32(1.2**2)
"""Source pixels per target pixel, squared, above which one place is not enough."""


class Planes(NamedTuple):
    """The pixels of a layer, or those that are drawn."""

    color: UInt8Array
    """H x W x 3."""
    depth: Float32Array
    """H x W, 0 = empty."""
    origin: UInt8Array
    confidence: Float32Array
    errors: Float32Array
    """H x W x 2, expected errors; without rows where there are none."""


class Sky(NamedTuple):
    """The far pixels of a layer; H x W each."""

    far: BoolArray
    blocks: UInt8Array
    """0; 1 where the four pixels from here on are far; 2 where those round them are, too
    (`sampling.far_blocks`)."""


@kernel
def shade_surface(
    first: Whole, last: Whole, drawn: ZBuffer, colors: MeshColors, average: Flag, source: Planes, out: Planes
) -> None:
    """Colours of a surface drawing: read between source pixels, never across an edge (`sampling.surface_color`).

    Where the source is drawn smaller and `average`: the mean of up to 4 places along a target pixel's row, and as many along
    its column, if all lie in whole quads. They are a source pixel apart at most, so none lies beyond an edge.
    """
    for ty in range(first, last):
        for tx in range(drawn.w.shape[1]):
            w = drawn.w[ty, tx]
            if w <= 0:
                continue
            out.depth[ty, tx] = 1.0 / w
            su, sv = drawn.where[ty, tx, 0], drawn.where[ty, tx, 1]
            nearest_row, nearest_column = np.int64(sv + HALF), np.int64(su + HALF)
            copy_provenance(source, nearest_row, nearest_column, out, ty, tx)
            red, green, blue, count = ZERO, ZERO, ZERO, ZERO
            if average:
                red, green, blue, count = sum_shrunk(drawn, ty, tx, colors)
            if count > ZERO:
                red, green, blue = red / count, green / count, blue / count
            else:
                red, green, blue = surface_color(su, sv, colors)
            set_color(out.color, ty, tx, red, green, blue)


@inlined
def copy_provenance(source: Planes, row: Whole, column: Whole, out: Planes, ty: Whole, tx: Whole) -> None:
    """Origin, confidence and expected errors of a pixel seen in another view: there what was measured is reprojected."""
    origin = source.origin[row, column]
    out.origin[ty, tx] = REPROJECTED if origin == MEASURED else origin
    out.confidence[ty, tx] = source.confidence[row, column]
    if len(source.errors) > 0 and len(out.errors) > 0:
        for part in range(2):
            out.errors[ty, tx, part] = source.errors[row, column, part]


@inlined
def set_color(out: UInt8Array, row: Whole, column: Whole, red: Real, green: Real, blue: Real) -> None:
    """The nearest levels in 0 .. 255."""
    out[row, column, 0], out[row, column, 1], out[row, column, 2] = level(red), level(green), level(blue)


@inlined
def sum_shrunk(drawn: ZBuffer, ty: Whole, tx: Whole, colors: MeshColors) -> tuple[Real, Real, Real, Real]:
    """Summed red, green, blue of the places of a target pixel whose source is drawn smaller, and their number; number 0: it is
    not, or a place lies in no whole quad."""
    across_u, across_v = stride(drawn, ty, tx, ty, tx + 1)
    down_u, down_v = stride(drawn, ty, tx, ty + 1, tx)
    wide_2, high_2 = across_u * across_u + across_v * across_v, down_u * down_u + down_v * down_v
    red, green, blue = ZERO, ZERO, ZERO
    if wide_2 <= SHRUNK_2 and high_2 <= SHRUNK_2:
        return red, green, blue, ZERO
    wide, high = places(wide_2), places(high_2)
    for y in range(np.int64(high)):
        aside = (np.float32(y) + HALF) / high - HALF
        for x in range(np.int64(wide)):
            along = (np.float32(x) + HALF) / wide - HALF
            u = drawn.where[ty, tx, 0] + along * across_u + aside * down_u
            v = drawn.where[ty, tx, 1] + along * across_v + aside * down_v
            if not in_whole_quad(u, v, colors):
                return red, green, blue, ZERO
            r, g, b = surface_color(u, v, colors)
            red, green, blue = red + r, green + g, blue + b
    return red, green, blue, wide * high


@piece
def in_whole_quad(u: Real, v: Real, colors: MeshColors) -> Flag:
    """Whether a source column, row lies between four pixels that are all joined."""
    height, width = colors.joined.shape
    left, upper = np.int64(u), np.int64(v)
    if u < 0 or v < 0 or left >= width - 1 or upper >= height - 1:
        return False
    return colors.smooth[upper, left] > 0 or quad_sides(colors.joined, upper, left) == 15


@piece
def places(length_2: Real) -> Real:
    """How many places, 1 .. 4, one target pixel needs where the next is so far on in the source, squared (a float32)."""
    return ONE if length_2 <= SHRUNK_2 else min(np.ceil(np.sqrt(length_2)), np.float32(4))


@inlined
def stride(drawn: ZBuffer, ty: Whole, tx: Whole, y: Whole, x: Whole) -> tuple[Real, Real]:
    """Source columns and rows from a target pixel to its neighbour (y, x); 0, 0 where none is or it is on another surface."""
    w, where = drawn.w, drawn.where
    if y >= w.shape[0] or x >= w.shape[1] or w[y, x] <= 0:
        return ZERO, ZERO
    u, v = where[y, x, 0] - where[ty, tx, 0], where[y, x, 1] - where[ty, tx, 1]
    if abs(u) > 4 or abs(v) > 4:
        return ZERO, ZERO
    return u, v


@kernel
def shade_points(first: Whole, last: Whole, nearest: NDArray[np.uint64], points: Planes, out: Planes) -> None:
    """Each pixel shows its nearest point as it is. nearest: H x W, of `drop_points`; points: planes of N x 1, not H x W."""
    for ty in range(first, last):
        for tx in range(nearest.shape[1]):
            if nearest[ty, tx] > 0:
                point = np.int64(LARGEST - (nearest[ty, tx] & LARGEST))
                out.depth[ty, tx] = points.depth[point, 0]
                for channel in range(3):
                    out.color[ty, tx, channel] = points.color[point, 0, channel]
                copy_provenance(points, point, 0, out, ty, tx)


@inlined
def sky_color(su: Real, sv: Real, sky: Sky, knots: Float32Array, color: UInt8Array) -> tuple[Real, Real, Real]:
    """Colour at a place of the source (px): by the sky's blocks that of its pixel, bilinear or `sampling.smooth_color`."""
    height, width = sky.far.shape
    left, upper = math.floor(su - 0.5), math.floor(sv - 0.5)
    fu, fv = su - 0.5 - left, sv - 0.5 - upper
    if not (0 <= left < width - 1 and 0 <= upper < height - 1) or sky.blocks[upper, left] == 0:
        return at_pixel(color, np.int64(sv), np.int64(su))
    if sky.blocks[upper, left] == 2:
        return smooth_color(knots, width, upper, left, fu, fv)
    return bilinear(color, upper, left, ((1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv))


@kernel
def shade_far(
    first: Whole, last: Whole, matrix: Float64Array, sky: Sky, knots: Float32Array, source: Planes, out: Planes
) -> None:
    """The far layer behind everything: empty target pixels (depth 0) whose direction is far in the source.

    matrix: 3x3, K_source R K_target^-1 (rotation alone: what is far does not shift when the camera moves).
    """
    height, width = sky.far.shape
    for ty in range(first, last):
        y = ty + 0.5
        for tx in range(out.depth.shape[1]):
            if out.depth[ty, tx] != 0:
                continue
            x = tx + 0.5
            ahead = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2]
            if ahead <= 1e-9:
                continue
            across = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2]
            along = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2]
            su, sv = across / ahead, along / ahead
            if not (0 <= su < width and 0 <= sv < height):
                continue
            column, row = np.int64(su), np.int64(sv)
            if not sky.far[row, column]:
                continue
            out.depth[ty, tx] = np.inf
            copy_provenance(source, row, column, out, ty, tx)
            red, green, blue = sky_color(su, sv, sky, knots, source.color)
            set_color(out.color, ty, tx, red, green, blue)
