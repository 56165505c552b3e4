"""Out of view: known surfaces on a coarse grid in; how far each plane is visible along its lines, and the cost of each label,
out.

A wall that the border cuts continues along its horizontals. Of planes visible over T cells and continued over t, the share T /
(T + t) continues for t more. A plane hides what is behind it. It has ended where its line looks past it, at the sky above, at
a surface behind its end, or where a source camera saw the sky through it. Where no line meets the plane, it was never seen to
extend there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.holes import dilate_mask, morphological_close, repeat_cells
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.layered.kernels.lines import Cells, Directions, Found, line_rows

LEVEL = 0.8
"""Least cosine of the angle between a plane's normal and the camera's vertical for the plane to be ground."""
FOLLOWED = 0.01
"""Least share of the known cells of a plane that is followed along lines: an eave that the border cuts has little more. At .02
LPIPS of street s03 is 2 % higher (s05 unchanged), and on worlds depth out of view is off by up to 40 % more."""
STRIDE, STRIDE_ACROSS = 2, 4
"""Sampling step, in cells, of the lines along the horizontals, and across."""
CONTINUED_COST = 0.5
"""Cost, per log(1 + t / T), of a plane continued over t cells along its horizontals and visible over T; twice that across them,
where nothing is visible along: an eave is narrow."""
MOST_HIDDEN = 3.0
"""Largest cost of surfaces hidden by such a plane: log(1 + T / t)."""
PAST = 2.0
"""Cost of a plane where its line looks past it, and where no line meets it."""
IN_FRONT = 1.05
"""Relative inverse depth from which a plane hides another surface."""
ENDING_COST = 1.0
"""Largest cost of a surface out of view that should have ended; it grows twice as fast as the cost of distance."""
CROWN_COST = 3.0
"""Cost of no plane next to foliage that the border cuts: foliage extends as its circle."""
HORIZON = 1e-3
"""Inverse depth at which planes end: 1 km."""
CUT_CELLS = 3
"""A plane with so many known cells next to the hole out of view is cut by the border."""


@dataclass(frozen=True, eq=False)
class CoarseCells:
    """Cells of a grid, h x w: one sample of each. Labels: -1 none, 0 sky, k >= 1 planes."""

    camera: Camera
    """Of the grid."""
    hole: BoolArray
    """h x w, True in cells that hold a hole pixel."""
    hole_in_view: BoolArray
    """h x w, True in the part of the hole that is inside the source's view."""
    inverse_depth: Float32Array
    """h x w, 1/m, of the known cells."""
    label: NDArray[np.int8]
    """h x w, of the known cells."""
    candidates: Float32Array
    """L x h x w inverse depth (1/m) that each label would give: no plane, sky, planes."""

    @cached_property
    def unseen(self) -> BoolArray:
        """h x w, True in the part of the hole that is out of the source's view."""
        return self.hole & ~self.hole_in_view

    @cached_property
    def horizon(self) -> float:
        """Inverse depth (1/m) at which planes end: where known cells are nearly as far as HORIZON or farther, a tenth of
        theirs."""
        known = self.inverse_depth[~self.hole & (self.inverse_depth > 0)]
        return min(HORIZON, 0.1 * float(np.quantile(known, 0.01))) if known.size else HORIZON

    @cached_property
    def near_unseen(self) -> BoolArray:
        """h x w, True in and near `unseen` cells."""
        return cells_near(self.unseen)

    @cached_property
    def plane_cells(self) -> NDArray[np.int64]:
        """How many known cells each plane (K) holds."""
        return np.bincount(self.label[~self.hole].clip(0), minlength=len(self.candidates) - 1)[1:]


def cells_near(unseen: BoolArray) -> BoolArray:
    """h x w, True within 2 cells of `unseen` cells, and in them."""
    return dilate_mask(unseen, 2)


class PlaneLines(NamedTuple):
    """Planes on a grid of cells, and the vanishing points of their lines."""

    planes: NDArray[np.float64]
    """K x 3 (a, b, c), w = a x + b y + c over cells."""
    along: NDArray[np.float64]
    """K x 3, homogeneous, in cells: vanishing point of each plane's horizontals."""
    across: NDArray[np.float64]
    """K x 3: vanishing point of its lines at right angles to them."""
    past: BoolArray
    """K x h x w, the hole cells in which a source camera saw the sky through each plane."""
    away: Float32Array
    """K x h x w distance to known cells, or such, in cells."""
    by_edges: BoolArray
    """K, True where lines run along the plane's own edges (`plane_edges`): a table top, which hangs over what is below it."""

    @classmethod
    def of(cls, cells: CoarseCells, past: BoolArray) -> PlaneLines:
        """Of the planes of a grid; past: see the field."""
        planes = plane_coefficients(cells.candidates[2:])
        points = vanishing_points(planes, cells.camera, cells.plane_cells)
        away = np.zeros(past.shape, np.float32)
        for k, there in enumerate(past):
            away[k] = cv2.distanceTransform((cells.hole & ~there).view(np.uint8), cv2.DIST_L2, 5)
        return cls(planes, *points, past, away, np.zeros(len(planes), np.bool_))


def seen_on_lines(
    lines: PlaneLines,
    towards: NDArray[np.float64],
    cells: CoarseCells,
    followed: BoolArray,
    stride: int,
    asking: BoolArray,
) -> Found:
    """K x h' x w' cells from each queried cell to the plane along its line, and the length over which the plane is seen there.

    towards: K x 3, homogeneous vanishing point of each plane's lines; followed: K, the planes that are looked for; asking:
    h x w, of which every stride-th row and column is queried. -1: undecided, or not looked for; length 0: the line looks behind
    the plane.
    """
    height, width = (-(-size // stride) for size in cells.hole.shape)
    first = np.full((len(lines.planes), height, width), -1, np.float32)
    found = Found(first, np.zeros_like(first), np.zeros(first.shape, np.int8))
    directions = Directions(lines.planes, towards, followed, cells.horizon)
    over = Cells(cells.inverse_depth, cells.label, cells.hole, lines.past, lines.away)
    in_bands(line_rows, height, directions, over, asking, stride, found, band=8)
    return found


def follow_lines(
    lines: PlaneLines, cells: CoarseCells, followed: BoolArray, sky: bool = True
) -> tuple[Float32Array, Float32Array]:
    """(on, cost), both L x h x w, 0 except in cells out of view: 0..1, how far a label is visible along its line; cost of each
    label. followed: K, the planes that are followed; sky: whether the scene has any, in which a plane could hang.
    """
    candidates, unseen, hw = cells.candidates, cells.unseen, cells.hole.shape
    on, cost = np.zeros(candidates.shape, np.float32), np.zeros(candidates.shape, np.float32)
    if not unseen.any() or not followed.any():
        return on, cost
    first, length, _ = seen_on_lines(lines, lines.along, cells, followed, STRIDE, unseen)
    found_across = seen_on_lines(lines, lines.across, cells, followed, STRIDE_ACROSS, unseen)
    few = candidates[:, ::STRIDE, ::STRIDE], unseen[::STRIDE, ::STRIDE]
    few_on, few_cost = np.zeros_like(few[0]), np.zeros_like(few[0])
    hidden = np.zeros_like(few[0])
    for k in 2 + np.flatnonzero(followed):
        value = few[0][k]
        ends = has_ended(first[k - 2], length[k - 2], between=sky and not lines.by_edges[k - 2])
        there = (length[k - 2] > 0) & ~ends
        farther = np.maximum(first[k - 2], 1) / np.maximum(length[k - 2], 1)
        few_on[k] = there
        few_cost[k] = np.where(there, CONTINUED_COST * np.log1p(farther), PAST * ends)
        away, seen = (repeat_cells(one[k - 2], STRIDE_ACROSS // STRIDE, ends.shape) for one in found_across[:2])
        nothing = ~there & ~ends & (first[k - 2] < 0)
        across_it = 2 * CONTINUED_COST * np.log1p(np.maximum(away, 1) / np.maximum(seen, 1))
        few_cost[k] += nothing * np.where(seen > 0, across_it, PAST * (away < 0))
        hides = there * np.minimum(np.log1p(1 / farther), MOST_HIDDEN)
        np.maximum(hidden, hides * (IN_FRONT * few[0] < value), out=hidden)
    weight = few[1].astype(np.float32)
    total = np.maximum(enlarge_strided(weight, hw), 1e-6)
    for out, values in ((on, few_on), (cost, few_cost + hidden)):
        for number in np.flatnonzero(values.any((1, 2))):
            out[number] = enlarge_strided(values[number] * weight, hw) / total * unseen
    return on, cost


def continue_between(
    lines: PlaneLines, cells: CoarseCells, followed: BoolArray, removed: BoolArray
) -> tuple[Float32Array, Float32Array]:
    """As `follow_lines`, in cells of removed objects (h x w): a plane that its line sees in both ways continues between, so that
    a wall ends at its skyline, also where the sky above is nearer than the wall to either side."""
    on, hidden = np.zeros(cells.candidates.shape, np.float32), np.zeros(cells.candidates.shape, np.float32)
    if not removed.any() or not followed.any():
        return on, hidden
    found = seen_on_lines(lines, lines.along, cells, followed, 1, removed)
    first, length, ways = (one[:, removed] for one in found)
    on[2:, removed] = ways == 2
    hides = (ways == 2) * np.minimum(np.log1p(length / np.maximum(first, 1)), MOST_HIDDEN)
    values = cells.candidates[:, removed]
    hidden[:, removed] = (hides * (IN_FRONT * values[:, None] < values[2:])).max(1)
    return on, hidden


def ending_cost(cells: CoarseCells, followed: BoolArray, beyond: Float32Array, jump: float) -> Float32Array:
    """L x h x w cost in cells out of view of surfaces that should have ended: planes that are not followed (K) and end within the
    picture, and no plane (a tree that the border cuts) `beyond` its extent.

    beyond: h x w cells, see `CutObjects`; jump: cells of distance that cost 1.
    """
    unseen = cells.unseen
    out = np.zeros(cells.candidates.shape, np.float32)
    if not unseen.any():
        return out
    for number in 2 + np.flatnonzero(~followed):
        if (cells.near_unseen & ~cells.hole & (cells.label == number - 1)).sum() < CUT_CELLS:
            out[number] = ENDING_COST * unseen
    out[0] = np.where(np.isinf(beyond), CROWN_COST, np.minimum(2 * beyond / jump, ENDING_COST)) * unseen
    return out


def has_ended(first: Float32Array, length: Float32Array, between: bool = True) -> BoolArray:
    """h x w, True where a plane has ended: its line looks past it or, with `between`, the cell lies between such cells, up to 41
    cells apart, or a border: no plane hangs in the air.

    first, length: h x w, as of `seen_on_lines`, of one plane.
    """
    past = (first > 0) & (length == 0)
    if not between:
        return past
    above = np.cumsum(first > 0, axis=0) == 0
    reach = 41 // STRIDE | 1
    closed = morphological_close(np.pad(past | above, ((reach, reach), (0, 0))), np.ones((reach, 1), np.uint8))
    return np.asarray(past | (closed[reach:-reach] & (length > 0)))


def enlarge_strided(values: Float32Array, hw: tuple[int, ...]) -> Float32Array:
    """Values of every STRIDE-th cell (h' x w'), interpolated to h x w cells."""
    height, width = (STRIDE * size for size in values.shape)
    return np.asarray(cv2.resize(values, (width, height), interpolation=cv2.INTER_LINEAR)[: hw[0], : hw[1]], np.float32)


def plane_coefficients(candidates: Float32Array) -> NDArray[np.float64]:
    """K x 3 (a, b, c), w = a x + b y + c over cells (the first: x = y = 0), of K x h x w inverse depths."""
    corner = candidates[:, 0, 0].astype(np.float64)
    height, width = (max(size - 1, 1) for size in candidates.shape[1:])
    steps = (candidates[:, 0, -1] - corner) / width, (candidates[:, -1, 0] - corner) / height
    return np.stack([*steps, corner], axis=1).reshape(-1, 3)


def normals(planes: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """K x 3 unit normals, in camera axes, of planes w = a x + b y + c over cells."""
    n = planes @ matrix_of_cells(camera)
    return np.asarray(n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-12), np.float64)


def matrix_of_cells(camera: Camera) -> NDArray[np.float64]:
    """3 x 3: K of cells, of which the first has its centre at 0."""
    return np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1]])


def estimate_up(normal: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Up in camera axes: the normal (K x 3) of the level plane with most cells (K), else the camera's own."""
    level = np.flatnonzero((np.abs(normal[:, 1]) > LEVEL) & (cells > 0))
    if not len(level):
        return np.array([0.0, -1.0, 0.0])
    ground = normal[level[cells[level].argmax()]]
    return np.asarray(-ground * np.sign(ground[1]))


def vanishing_points(
    planes: NDArray[np.float64], camera: Camera, cells: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """K x 3 and K x 3, homogeneous, in cells: vanishing points of each plane's horizontals and of its lines at right angles to
    them.

    A level plane takes those of the largest upright one, or lines from left to right; cells: K, known cells of each.
    """
    normal = normals(planes, camera)
    up = estimate_up(normal, cells)
    direction = np.cross(normal, up)
    upright = np.linalg.norm(direction, axis=1) > 0.5  # by 30 degrees
    main = direction[upright][cells[upright].argmax()] if upright.any() else np.cross(up, [0.0, 0.0, 1.0])
    direction = np.where(upright[:, None], direction, main)
    K = matrix_of_cells(camera)
    points = [d @ K.T for d in (direction, np.cross(normal, direction))]
    along, across = (p / np.maximum(np.linalg.norm(p, axis=1, keepdims=True), 1e-12) for p in points)
    return along, across


def above_horizon(cells: CoarseCells) -> BoolArray:
    """h x w, True in cells that look upwards."""
    up = estimate_up(normals(plane_coefficients(cells.candidates[2:]), cells.camera), cells.plane_cells)
    return np.asarray(rays(cells.camera) @ up > 0)
