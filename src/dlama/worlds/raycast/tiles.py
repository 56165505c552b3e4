"""Shapes, texels, a light and a camera in; colour, planar depth and what was hit out, tile by tile (numba).

A tile's rays meet few of the shapes, which are listed once. Every pixel is computed alone: the result does not depend on the
number of threads.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Real, Whole, in_bands, inlined, kernel
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.worlds.raycast.shading import ray
from dlama.worlds.raycast.shape_rows import TILE_PX


@inlined
def list_tile(
    boxes: Float64Array,
    order: NDArray[np.integer],
    camera: Float64Array,
    x0: Whole,
    y0: Whole,
    x1: Whole,
    y1: Whole,
    listed: NDArray[np.int32],
    near_z: Float64Array,
) -> Whole:
    """Shapes whose bounding box may meet the rays of a tile, in the given order (nearest first); returns how many."""
    left, right = (x0 - camera[14]) / camera[12], (x1 - camera[14]) / camera[12]
    top, bottom = (y0 - camera[15]) / camera[13], (y1 - camera[15]) / camera[13]
    count = 0
    for j in range(len(order)):
        b = boxes[j]
        if (
            reach(b, 1.0, 0.0, -left) >= 0
            and reach(b, -1.0, 0.0, right) >= 0
            and reach(b, 0.0, 1.0, -top) >= 0
            and reach(b, 0.0, -1.0, bottom) >= 0
        ):
            listed[count], near_z[count] = order[j], b[12]
            count += 1
    return count


@inlined
def reach(b: Float64Array, nx: Real, ny: Real, nz: Real) -> Real:
    """The largest n . p over a box given in camera axes as its centre and three half edges."""
    total = nx * b[0] + ny * b[1] + nz * b[2]
    for k in range(3, 12, 3):
        total += abs(nx * b[k] + ny * b[k + 1] + nz * b[k + 2])
    return total


@inlined
def to_byte(value: Real) -> np.uint8:
    """Linear light 0..1 as 8 bit."""
    return np.uint8(255 * math.sqrt(max(0.0, min(1.0, value))) + 0.5)


@inlined
def is_edge(keys: NDArray[np.int32], lights: UInt8Array, row: Whole, column: Whole) -> bool:
    """True where one of the 8 neighbours shows another surface or stands in another light."""
    rows, columns = keys.shape
    for r in range(max(row - 1, 0), min(row + 2, rows)):
        for c in range(max(column - 1, 0), min(column + 2, columns)):
            if keys[r, c] != keys[row, column] or lights[r, c] != lights[row, column]:
                return True
    return False


@kernel
def cast_tiles(
    first: Whole,
    last: Whole,
    phase: Whole,
    shapes: Float64Array,
    texels: UInt8Array,
    boxes: Float64Array,
    order: NDArray[np.integer],
    camera: Float64Array,
    light: Float64Array,
    starts: NDArray[np.int32],
    items: NDArray[np.int32],
    skip: NDArray[np.int32],
    gone: Whole,
    lists: NDArray[np.int32],
    nears: Float64Array,
    counts: NDArray[np.int32],
    color: UInt8Array,
    depth: Float32Array,
    keys: NDArray[np.int32],
    lights: UInt8Array,
) -> None:
    """Rows of tiles of `cast_rays`. Phase 0 lists each tile's shapes and sends a ray through every pixel's centre, phase 1 four
    through every pixel at an edge. lists, nears: tiles x shapes, counts: tiles, filled in phase 0."""
    rows, columns = depth.shape
    across = (columns + TILE_PX - 1) // TILE_PX
    for tile in range(first * across, last * across):
        y0, x0 = tile // across * TILE_PX, tile % across * TILE_PX
        y1, x1 = min(y0 + TILE_PX, rows), min(x0 + TILE_PX, columns)
        listed, near_z = lists[tile], nears[tile]
        if phase == 0:
            counts[tile] = list_tile(boxes, order, camera, x0, y0, x1, y1, listed, near_z)
        for row in range(y0, y1):
            for column in range(x0, x1):
                if phase == 1 and not is_edge(keys, lights, row, column):
                    continue
                red, green, blue = 0.0, 0.0, 0.0
                for k in range(4 if phase == 1 else 1):
                    x = column + 0.5 + (0.125 * (1 + 2 * (k // 2)) * (1 - 2 * (k % 2)) if phase == 1 else 0.0)
                    y = row + 0.5 + (0.125 * (3 - 2 * (k // 2)) * (2 * ((k + k // 2) % 2) - 1) if phase == 1 else 0.0)
                    r, g, b, z, key, state = ray(
                        shapes, texels, listed, counts[tile], near_z, skip[row, column], gone,
                        camera, light, starts, items, x, y, 1.0 - 0.5 * phase,
                    )  # fmt: skip
                    red, green, blue = red + r, green + g, blue + b
                    if phase == 0:
                        depth[row, column], keys[row, column], lights[row, column] = z, key, state
                share = 0.25 if phase == 1 else 1.0
                color[row, column, 0] = to_byte(share * red)
                color[row, column, 1] = to_byte(share * green)
                color[row, column, 2] = to_byte(share * blue)


def cast_rays(
    shapes: Float64Array,
    texels: UInt8Array,
    boxes: Float64Array,
    order: NDArray[np.integer],
    camera: Float64Array,
    light: Float64Array,
    starts: NDArray[np.int32],
    items: NDArray[np.int32],
    skip: NDArray[np.int32],
    gone: Whole,
    smooth: Whole,
    color: UInt8Array,
    depth: Float32Array,
    keys: NDArray[np.int32],
    lights: UInt8Array,
) -> None:
    """Fills color (H x W x 3), depth, keys and lights (H x W) of one frame.

    Depth, key and light are those of the ray through the pixel's centre. `skip` (H x W): the group each pixel sees
    through, -1 none; `gone`: the group that casts no shadow. `smooth` > 0: pixels at edges take the mean colour of four rays.
    """
    down, across = (-(-size // TILE_PX) for size in depth.shape)
    lists, nears = np.empty((down * across, len(order)), np.int32), np.empty((down * across, len(order)))
    counts = np.empty(down * across, np.int32)
    scene = shapes, texels, boxes, order, camera, light, starts, items, skip, gone
    for phase in range(1 + smooth):
        in_bands(cast_tiles, down, phase, *scene, lists, nears, counts, color, depth, keys, lights, band=1)
