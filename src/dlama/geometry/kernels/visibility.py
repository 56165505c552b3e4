"""Numba kernels of the visibility law, filled depth of a target view against what a source camera measured; and of one frame's
points against what another one measured."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Flag, Real, Whole, kernel, piece
from dlama.geometry.projection import PixelMap
from dlama.geometry.rgbd import BoolArray, Float32Array


@piece
def tolerance(depth: Real) -> Real:
    """The larger of 1 mm and 0.1 %."""
    return max(1e-3, 1e-3 * depth)


@piece
def ray(matrix: Float64Array, row: Whole, column: Whole) -> tuple[Real, Real, Real]:
    """Where a target pixel's ray points, in homogeneous source pixels."""
    x, y = column + 0.5, row + 0.5
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2],
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2],
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2],
    )


@piece
def pixel_at(place: Whole, width: Whole) -> tuple[Whole, Whole]:
    """Row and column of a flat number. Divided in 32 bits without a sign: an int64 takes four times as long."""
    row = np.int64(np.uint32(place) // np.uint32(width))
    return row, place - row * width


@piece
def pixel_on_ray(
    ax: Real, ay: Real, az: Real, offset: Float64Array, depth: Real, measured: Float32Array
) -> tuple[Real, Whole, Whole]:
    """Depth, row and column in the source of the point at `depth` on the ray; row -1: it is not in the source's picture.

    (ax, ay, az): the ray in source pixels; measured: of the source's height and width.
    """
    z = depth * az + offset[2]
    across, along = depth * ax + offset[0], depth * ay + offset[1]
    if z <= 0 or across < 0 or along < 0 or across > z * (measured.shape[1] + 1) or along > z * (measured.shape[0] + 1):
        return z, np.int64(-1), np.int64(-1)  # most are clearly outside: no division for them
    x, y = across / z, along / z
    if not (x < measured.shape[1] and y < measured.shape[0]):
        return z, np.int64(-1), np.int64(-1)
    return z, np.int64(y), np.int64(x)


@piece
def breaks_law(ax: Real, ay: Real, az: Real, offset: Float64Array, depth: Real, measured: Float32Array) -> Flag:
    """True if the point at `depth` on the ray is, seen from the source, in front of what was measured there.

    (ax, ay, az): the ray in source pixels; measured: source depth, 0 = nothing measured, inf = far.
    """
    if not depth < np.inf:
        return False
    z, row, column = pixel_on_ray(ax, ay, az, offset, depth, measured)
    if row < 0:
        return False
    limit = measured[row, column]
    if limit <= 0:
        return False
    return limit == np.inf or z < limit - tolerance(limit)


class Pixels(NamedTuple):
    """Some pixels of a picture."""

    places: NDArray[np.int32]
    """N, their flat numbers."""
    depth: Float32Array
    """N, > 0."""
    width: Whole
    """Of the picture."""


@kernel
def violations(
    first: Whole, last: Whole, pixels: Pixels, to_source: PixelMap, measured: Float32Array, out: BoolArray
) -> None:
    """Mark, in `out`, those of the pixels first..last whose depth breaks the law of one source."""
    for n in range(first, last):
        if not out[n]:
            ax, ay, az = ray(to_source.matrix, *pixel_at(pixels.places[n], pixels.width))
            out[n] = breaks_law(ax, ay, az, to_source.offset, np.float64(pixels.depth[n]), measured)


@piece
def crossing(a: Real, b: Real, offset_a: Real, offset_b: Real, border: Real) -> Real:
    """Depth at which (a d + offset_a) / (b d + offset_b) equals `border`; inf if never."""
    slope = border * b - a
    if slope == 0:
        return np.inf
    return (offset_a - border * offset_b) / slope


@piece
def next_crossing(
    ax: Real, ay: Real, az: Real, offset: Float64Array | tuple[Real, Real, Real], depth: Real, x: Real, y: Real
) -> Real:
    """The depth > `depth` at which the ray enters another source pixel; inf if it stays in this one for ever."""
    nearest = np.inf
    for border in (np.floor(x), np.floor(x) + 1):
        d = crossing(ax, az, offset[0], offset[2], border)
        if d > depth * (1 + 1e-9):
            nearest = min(nearest, d)
    for border in (np.floor(y), np.floor(y) + 1):
        d = crossing(ay, az, offset[1], offset[2], border)
        if d > depth * (1 + 1e-9):
            nearest = min(nearest, d)
    return nearest


@piece
def lawful_depth(ax: Real, ay: Real, az: Real, offset: Float64Array, depth: Real, measured: Float32Array) -> Real:
    """The smallest depth >= `depth` on the ray that keeps the law: a walk from source pixel to source pixel, outwards."""
    for _ in range(4 * (measured.shape[0] + measured.shape[1])):
        if not breaks_law(ax, ay, az, offset, depth, measured):
            return depth
        z = depth * az + offset[2]
        x, y = (depth * ax + offset[0]) / z, (depth * ay + offset[1]) / z
        out = next_crossing(ax, ay, az, offset, depth, x, y)
        limit = measured[np.int64(y), np.int64(x)]
        if limit < np.inf and az > 0:
            behind = (limit - offset[2]) / az
            if behind < out:
                return behind
        if out == np.inf:
            return np.inf
        depth = out * (1 + 1e-6)
    return np.inf


@kernel
def push_back(first: Whole, last: Whole, pixels: Pixels, to_source: PixelMap, measured: Float32Array) -> None:
    """Move the pixels first..last (their depth, in place) outwards until they keep the law of one source."""
    for n in range(first, last):
        ax, ay, az = ray(to_source.matrix, *pixel_at(pixels.places[n], pixels.width))
        pixels.depth[n] = lawful_depth(ax, ay, az, to_source.offset, np.float64(pixels.depth[n]), measured)


class Compared(NamedTuple):
    """A frame that another one's points are compared with."""

    way: PixelMap
    """To its pixels."""
    depth: Float32Array
    """H x W metres, 0 = none, inf = far."""
    nearest: Float32Array
    """H x W, the nearest depth measured around each pixel with depth; 0 elsewhere."""
    earlier: Flag
    """Whether it comes first: what it shows itself is redundant, too."""


@kernel
def drop_redundant(
    first: Whole, last: Whole, depth: Float32Array, other: Compared, limits: Float64Array, added: BoolArray
) -> None:
    """Clear, in `added` (H x W), points of rows first..last that another frame saw through, or shows itself if it comes first.

    limits: relative difference in depth, and deviations in metres and in 1/m (of depth squared), within which two depths are one
    surface.
    """
    for row in range(first, last):
        for column in range(depth.shape[1]):
            if not added[row, column]:
                continue
            ax, ay, az = ray(other.way.matrix, row, column)
            metres = np.float64(depth[row, column])
            z, y, x = pixel_on_ray(ax, ay, az, other.way.offset, metres, other.depth)
            if y < 0:
                continue
            there, near = other.depth[y, x], other.nearest[y, x]
            limit = max(limits[0] * z, np.sqrt(limits[1] ** 2 + (limits[2] * z * z) ** 2))
            through = near > 0 and z < near - 2 * limit
            if through or (other.earlier and there > 0 and abs(there - z) <= limit):
                added[row, column] = False
