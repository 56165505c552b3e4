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
from dlama.worlds.raycast.intersection import Scene
from dlama.worlds.raycast.shading import ray
from dlama.worlds.raycast.shape_rows import TILE_PX

Boxes = tuple[Float64Array, NDArray[np.int32]]
"""Bounding boxes before a camera, nearest first, and whose they are (`bounding_boxes.boxes_by_depth`)."""
Lists = tuple[NDArray[np.int32], Float64Array, NDArray[np.int32]]
"""Of each tile: the shapes that its rays may meet and their nearest depths (tiles x shapes), and how many there are."""
Seen = tuple[UInt8Array, Float32Array, NDArray[np.int32], UInt8Array]
"""Colour (H x W x 3); depth, key and light (H x W) of the ray through each pixel's centre."""


@inlined
def list_tile(
    boxes: Boxes, camera: Float64Array, tile: tuple[Whole, Whole, Whole, Whole], lists: Lists, at: Whole
) -> None:
    """Note, at a place of the lists, the shapes whose bounding box may meet the rays of a tile (left, top, right, bottom; px)."""
    left, right = (tile[0] - camera[14]) / camera[12], (tile[2] - camera[14]) / camera[12]
    top, bottom = (tile[1] - camera[15]) / camera[13], (tile[3] - camera[15]) / camera[13]
    count = 0
    for j in range(len(boxes[1])):
        b = boxes[0][j]
        if (
            reach(b, 1.0, 0.0, -left) >= 0
            and reach(b, -1.0, 0.0, right) >= 0
            and reach(b, 0.0, 1.0, -top) >= 0
            and reach(b, 0.0, -1.0, bottom) >= 0
        ):
            lists[0][at, count], lists[1][at, count] = boxes[1][j], b[12]
            count += 1
    lists[2][at] = count


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
    scene: Scene,
    boxes: Boxes,
    camera: Float64Array,
    hidden: tuple[NDArray[np.int32], Whole],
    lists: Lists,
    seen: Seen,
) -> None:
    """Rows of tiles of `cast_rays`. Phase 0 lists each tile's shapes and sends a ray through every pixel's centre, phase 1 four
    through every pixel at an edge. The lists are filled in phase 0."""
    color, depth, keys, lights = seen
    skip, gone = hidden
    rows, columns = depth.shape
    across = (columns + TILE_PX - 1) // TILE_PX
    for tile in range(first * across, last * across):
        y0, x0 = tile // across * TILE_PX, tile % across * TILE_PX
        y1, x1 = min(y0 + TILE_PX, rows), min(x0 + TILE_PX, columns)
        if phase == 0:
            list_tile(boxes, camera, (x0, y0, x1, y1), lists, tile)
        sight = lists[0][tile], lists[1][tile], lists[2][tile]
        for row in range(y0, y1):
            for column in range(x0, x1):
                if phase == 1 and not is_edge(keys, lights, row, column):
                    continue
                red, green, blue = 0.0, 0.0, 0.0
                for k in range(1 + 3 * phase):
                    x = column + 0.5 + phase * 0.125 * (1 + 2 * (k // 2)) * (1 - 2 * (k % 2))
                    y = row + 0.5 + phase * 0.125 * (3 - 2 * (k // 2)) * (2 * ((k + k // 2) % 2) - 1)
                    light, z, key, state = ray(scene, sight, skip[row, column], gone, camera, (x, y), 1.0 - 0.5 * phase)
                    red, green, blue = red + light[0], green + light[1], blue + light[2]
                    if phase == 0:
                        depth[row, column], keys[row, column], lights[row, column] = z, key, state
                share = 1.0 - 0.75 * phase
                color[row, column, 0] = to_byte(share * red)
                color[row, column, 1] = to_byte(share * green)
                color[row, column, 2] = to_byte(share * blue)


def cast_rays(
    scene: Scene, boxes: Boxes, camera: Float64Array, skip: NDArray[np.int32], gone: int, smooth: bool
) -> Seen:
    """One frame.

    Args:
        camera: position, rotation and lens as 16 numbers.
        skip: H x W, the group that each pixel sees through, -1 none.
        gone: the group that casts no shadow.
        smooth: pixels at edges take the mean colour of four rays.
    """
    hw = skip.shape
    down, across = (-(-size // TILE_PX) for size in hw)
    tiles, shapes = down * across, len(boxes[1])
    lists = np.empty((tiles, shapes), np.int32), np.empty((tiles, shapes)), np.empty(tiles, np.int32)
    seen = np.empty((*hw, 3), np.uint8), np.empty(hw, np.float32), np.empty(hw, np.int32), np.empty(hw, np.uint8)
    for phase in range(1 + smooth):
        in_bands(cast_tiles, down, phase, scene, boxes, camera, (skip, gone), lists, seen, band=1)
    return seen
