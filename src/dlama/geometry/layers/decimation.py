"""A layer of a scene in; its surface in few triangles out, each within a tolerance of every pixel that it covers."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.cloud import Mesh
from dlama.geometry.codes import Origin
from dlama.geometry.depth_noise import measured_noise
from dlama.geometry.drawing.grid_mesh import mesh_grid
from dlama.geometry.fusion import HALVES, cell_halves
from dlama.geometry.holes import box_around
from dlama.geometry.kernels import decimating as kernels
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.projection import unproject
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, freeze, is_valid
from dlama.geometry.view import View

LARGEST = 64
"""px of the largest triangles' legs, a power of 2: larger ones would save little."""

DIAGONALS = (
    (True, (0, 1), ((0, 0), (0, 1), (1, 1))),
    (True, (1, 0), ((0, 0), (1, 1), (1, 0))),
    (False, (0, 0), ((0, 0), (0, 1), (1, 0))),
    (False, (1, 1), ((0, 1), (1, 1), (1, 0))),
)
"""The triangles that a square is cut into, above and below a diagonal that falls to the right, or does not: apex, corners."""
SIDES = (((0, 0.5), (0, 0), (0, 1)), ((1, 0.5), (1, 1), (1, 0)), ((0.5, 0), (1, 0), (0, 0)), ((0.5, 1), (0, 1), (1, 1)))
"""The sides of a square: middle, and both ends, clockwise."""

Corners = NDArray[np.int32]
"""N x 3 x 2: row and column of the pixels that are a triangle's corners."""


class DecimatedMesh(NamedTuple):
    """The surface of a layer, and where in its picture the vertices lie."""

    mesh: Mesh
    pixels: Float64Array
    """N x 2: x and y (px; the first pixel's centre is at 0.5) of the colour that each vertex has."""
    surface: BoolArray
    """H x W: the pixels of the layer that are shown."""


def decimate(
    view: View, share: float | None = None, grid: tuple[Float32Array, UInt8Array] | None = None
) -> DecimatedMesh:
    """The surface of a layer, with large triangles where it is flat.

    Vertices are pixels of the layer, at their own place in space. The loss: at each pixel that a triangle covers its depth
    differs by 1 mm or 0.1 % of the depth at most, whichever is more (where it was estimated 0.5 %, or the `share` that is given;
    noisy measured depth: as far as three standard deviations of its noise), and the place in the picture that its texture shows
    by half a pixel at most. Confidence is linear between vertices.
    Outlines are kept: no triangle covers pixels at both sides of a depth edge, nor of two origins unless it is as small as a
    pixel, but for specks of depth in missing depth and of missing depth in measured. Pixels that have no triangle in the
    grid, as those of a wire one pixel wide, become squares of their own size. Flying pixels, which rendering leaves out, and far
    ones have none. grid: the layer's `mesh_grid`, where it is another than that.
    """
    depth, joined = grid or mesh_grid(view)
    surface = is_valid(depth)
    box = box_around(surface, 0)
    noise = 0.0
    if share is None:
        share = 5e-3 if Origin.ESTIMATED in view.origins else 1e-3  # no estimate is as right as that
        noise = noise_tolerance(view, share)
    depth, joined = np.ascontiguousarray(depth[box]), joined[box]
    if depth.max(initial=0) == np.inf:  # sky
        depth = np.where(surface[box], depth, np.float32(0))
    halves = cell_halves(depth, joined)
    halved = halving_tree(depth, flat_cells(joined, without_specks(view.origin[box])), share, noise)
    del joined  # of a large picture it is as large as all that follows
    corners = np.concatenate(triangles(halved, halves, surface[box].shape))
    covered = covered_pixels(halves, surface[box].shape)
    del halves, halved
    lone_rows, lone_columns = np.nonzero(surface[box] & ~covered)
    used = np.zeros(covered.shape, bool)
    used[corners[..., 0], corners[..., 1]] = True
    rows, columns = np.nonzero(used)
    numbers = np.cumsum(used, dtype=np.int32).reshape(used.shape)[corners[..., 0], corners[..., 1]] - np.int32(1)
    del corners, covered, used
    first = len(rows) + 4 * np.arange(len(lone_rows), dtype=np.int32)[:, None]
    squares = np.concatenate([first + corner for corner in np.array([[0, 1, 2], [1, 3, 2]], np.int32)])
    rows, columns = np.append(rows, np.repeat(lone_rows, 4)), np.append(columns, np.repeat(lone_columns, 4))
    placed = depth[rows, columns]  # where edges were aligned with the picture's, it is not the view's
    rows, columns = rows + box[0].start, columns + box[1].start
    pixels = np.stack([columns, rows], 1) + 0.5
    places = pixels.copy()
    places[len(places) - len(squares) * 2 :] += np.tile(
        [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)], (len(lone_rows), 1)
    )
    planes = (freeze(plane[rows, columns]) for plane in (view.color, view.origin, view.confidence))
    vertices = unproject(view.camera, places[:, 0], places[:, 1], placed)
    mesh = Mesh(freeze(vertices), freeze(np.concatenate([numbers[:, ::-1], squares[:, ::-1]])), *planes)
    return DecimatedMesh(mesh, pixels, surface)


def noise_tolerance(view: View, share: float) -> float:
    """Inverse depth (1/m) by which triangles may miss noisy depth, for smaller ones would show its noise: three standard
    deviations of that; 0 where they are less than a `share` of the depth or DEPTH_METRES at the median distance: depth counts as
    exact."""
    noise = view.find_once(measured_noise)
    tolerance = 3 * noise.constant
    return tolerance if tolerance > noise.middle * max(share, kernels.DEPTH_METRES * noise.middle) else 0.0


def flat_cells(joined: UInt8Array, origin: UInt8Array) -> BoolArray:
    """(H - 1) x (W - 1): the squares of four pixels of one surface and one origin, which larger triangles may cover."""
    right = ((joined[:, :-1] & RIGHT) > 0) & (origin[:, :-1] == origin[:, 1:])
    down = ((joined[:-1] & DOWN) > 0) & (origin[:-1] == origin[1:])
    return np.asarray(right[:-1] & right[1:] & down[:, :-1] & down[:, 1:])


def without_specks(origin: UInt8Array) -> UInt8Array:
    """H x W origins in which specks that a sensor left open, or measured, are as most of the 5 x 5 pixels round them."""
    open_ = origin == Origin.DEPTH_FILLED
    if not open_.any():
        return origin
    most = cv2.medianBlur(open_.view(np.uint8), 5) > 0
    either = np.where(most, np.uint8(Origin.DEPTH_FILLED), np.uint8(Origin.MEASURED))
    return np.where(open_ | (origin == Origin.MEASURED), either, origin)


def covered_pixels(halves: tuple[BoolArray, ...], hw: tuple[int, ...]) -> BoolArray:
    """H x W, True at pixels that are corners of a triangle of the grid."""
    found = np.zeros(hw, bool)
    corner = {"a": found[:-1, :-1], "b": found[:-1, 1:], "c": found[1:, :-1], "d": found[1:, 1:]}
    for names, half in zip(HALVES, halves):
        for name in names:
            corner[name][...] |= half
    return found


def triangles(halved: UInt8Array, halves: tuple[BoolArray, ...], hw: tuple[int, ...]) -> list[Corners]:
    """The triangles of a grid of H x W pixels, corners clockwise in the picture, in parts; halved: `halving_tree`; halves: those
    of the smallest squares."""
    last = np.array(hw) - 1
    if last.min() < 1:
        return [np.zeros((0, 3, 2), np.int32)]
    found = list[Corners]()
    for size in (LARGEST >> level for level in range(LARGEST.bit_length() - 1)):
        centre = squares_at(halved, size, 0.5, 0.5)
        for chosen, (_, _, corners) in zip(diagonal_halves(halved, size), DIAGONALS):
            found.append(place_triangles(chosen & ~centre, size, *corners))
        for (y, x), one, other in SIDES:
            found.append(place_triangles(centre & ~squares_at(halved, size, y, x), size, one, other, (0.5, 0.5)))
    smallest = diagonal_halves(halved[: hw[0], : hw[1]], 1)
    both = (smallest[0] & smallest[1]) | (smallest[2] & smallest[3])
    for names, half in zip(HALVES, halves):
        found.append(place_triangles(half & both, 1, *(divmod("abcd".index(name), 2) for name in names)))
    for chosen, (_, _, corners) in zip(smallest, DIAGONALS):
        found.append(place_triangles(chosen & ~both, 1, *corners))
    return [drop_degenerate(np.minimum(part, last)) for part in found]


def halving_tree(depth: Float32Array, flat: BoolArray, share: float, noise: float) -> UInt8Array:
    """Which middles of longest sides halve triangles, on a lattice of whole squares of LARGEST (see `kernels.decimating`); share:
    of the depth that a triangle may be off; noise: inverse depth (1/m) by which it may be."""
    rows, columns = (-(-(side - 1) // LARGEST) for side in depth.shape)
    halved = np.zeros((rows * LARGEST + 1, columns * LARGEST + 1), np.uint8)
    if min(depth.shape) < 2:
        return halved
    relief = kernels.Relief(as_input(depth), flat.view(np.uint8), share, noise)
    in_bands(kernels.halve_smallest, len(depth), relief, halved)
    size = 2
    while size <= LARGEST:
        half = size // 2
        in_bands(kernels.halve, (len(halved) - 1) // half + 1, relief, half, False, halved)
        in_bands(kernels.halve, (len(halved) - 1) // size, relief, half, True, halved)
        size *= 2
    return halved


def squares_at(halved: UInt8Array, size: int, y: float, x: float) -> BoolArray:
    """Of each square of that size: whether triangles are halved at a place in it, 0 to 1 from its upper left corner."""
    (bottom, right), top, left = (side - 1 for side in halved.shape), int(y * size), int(x * size)
    return np.asarray(halved[top : top + bottom : size, left : left + right : size] > 0)


def diagonal_halves(halved: UInt8Array, size: int) -> list[BoolArray]:
    """Of each square and for each of DIAGONALS: whether the larger triangle was halved, so that it may have this one."""
    rows, columns = (np.arange((side - 1) // size) % 2 == 0 for side in halved.shape)
    falls = rows[:, None] == columns
    return [
        (falls == falling) & (squares_at(halved, size, *apex) | (size == LARGEST)) for falling, apex, _ in DIAGONALS
    ]


def place_triangles(chosen: BoolArray, size: int, *offsets: tuple[float, float]) -> Corners:
    """One triangle in each chosen square of that size; offsets: of the corners, in squares."""
    steps = np.rint(np.multiply(offsets, size)).astype(np.int32)
    squares = np.stack(np.divmod(np.flatnonzero(chosen).astype(np.int32), np.int32(chosen.shape[1])), 1)
    return (squares * np.int32(size))[:, None] + steps


def drop_degenerate(corners: Corners) -> Corners:
    """Without triangles that have no area. (Those at the picture's last row and column may have been folded.)"""
    (y0, x0), (y1, x1), (y2, x2) = corners.transpose(1, 2, 0)
    return corners[(x1 - x0) * (y2 - y0) > (x2 - x0) * (y1 - y0)]
