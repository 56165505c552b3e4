"""Edges of level planes: known cells in; planes whose lines run along their own straight edges, out.

A wall continues along its horizontals. A table top has no such direction of its own but its edges, and those continue straight.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.holes import dilate_mask, morphological_close, morphological_open, square
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.layered.out_of_view import (
    CUT_CELLS,
    LEVEL,
    PlaneLines,
    cells_of_planes,
    estimate_up,
    next_to,
    normals,
)

SMOOTHING = 2.0
"""Sigma, in cells, of the blur of a plane's cells whose gradient stands across their outline."""
SAME = 1.06
"""Ratio of inverse depths from which known cells lie beyond a plane."""
SEEN_PAST = 0.05
"""Such cells, as a share of the plane's own, from which it is seen to end: nothing lies beyond the ground."""
WIDE = 5
"""Side, in cells, of the square that a hole next to a plane must hold to be what the plane hid; a smaller one is the sensor's."""
LEAST_CELLS = 30
"""Fewer cells of an outline say nothing."""
AGREEING = np.radians(4.0)
"""Angle by which the outline at a cell may run next to a direction (sigma)."""
LEAST_AGREEING = 0.4
"""Share of the outline that must run in the two directions found. Table tops have .48 to .73, seats and scraps below .35."""
TURNS = 90
"""Directions that are tried, over a right angle."""


def align_lines_to_edges(
    lines: PlaneLines,
    camera: Camera,
    candidates: Float32Array,
    hole: BoolArray,
    unseen: BoolArray,
    w: Float32Array,
    label: NDArray[np.int32],
) -> PlaneLines:
    """The lines, those of level planes that the border of the picture cuts turned along their own edges.

    camera: of the grid; candidates: L x h x w inverse depth (1/m) of no plane, sky, planes; hole, unseen (its part out of view):
    h x w; w, label: h x w, of the known cells.
    """
    normal = normals(lines.planes, camera)
    level = np.abs(normal @ estimate_up(normal, cells_of_planes(label, hole, len(normal)))) > LEVEL
    by_edges, points = lines.by_edges.copy(), [lines.along.copy(), lines.across.copy()]
    adjacent = next_to(unseen) & ~hole
    for k in np.flatnonzero(level):
        there = morphological_close(~hole & (label == k + 1), square(WIDE))
        cut = there & adjacent
        beyond = ~hole & (SAME * w < candidates[k + 2])
        if cut.sum() < CUT_CELLS or beyond.sum() < SEEN_PAST * there.sum():
            continue
        # where the picture's border cuts a plane it has no outline
        outline = there & ~next_to(unseen) & dilate_mask(beyond | morphological_open(hole & ~unseen, square(WIDE)), 1)
        found = edge_directions(there, outline, normal[k], camera)
        if found is None:
            continue
        first = straight_across(cut, found)
        points[0][k], points[1][k], by_edges[k] = found[first], found[1 - first], True
    return lines._replace(along=points[0], across=points[1], by_edges=by_edges)


def edge_directions(
    there: BoolArray, outline: BoolArray, normal: NDArray[np.float64], camera: Camera
) -> NDArray[np.float64] | None:
    """2 x 3 vanishing points, homogeneous, in cells, of two directions at right angles in a plane along which most of its
    outline runs; None if none do.

    there: h x w, the cells of the plane; outline: h x w, those at its end; normal: 3, unit, camera axes.
    """
    rows, columns = np.nonzero(outline)
    if len(rows) < LEAST_CELLS:
        return None
    blurred = cv2.GaussianBlur(there.astype(np.float32), (0, 0), SMOOTHING)
    slope = np.stack([cv2.Sobel(blurred, cv2.CV_32F, *way)[rows, columns] for way in ((1, 0), (0, 1))], 1)
    across = np.asarray(slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9), np.float32)
    first = np.cross(normal, [0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    turn = np.arange(TURNS)[:, None] * (np.pi / 2 / TURNS)
    one, other = np.cos(turn) * first + np.sin(turn) * second, np.cos(turn) * second - np.sin(turn) * first
    K = np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1]])
    points = np.stack([one @ K.T, other @ K.T], 1)
    score = np.maximum(*(agreement(points[:, k], rows, columns, across) for k in (0, 1))).mean(1)
    best = int(score.argmax())
    return points[best] if score[best] >= LEAST_AGREEING else None


def agreement(
    points: NDArray[np.float64], rows: NDArray[np.intp], columns: NDArray[np.intp], across: Float32Array
) -> NDArray[np.float64]:
    """T x N, 0..1: how well an outline at N cells (`across` it: N x 2, x and y) runs towards T vanishing points (T x 3)."""
    dx, dy = (points[:, k, None] - points[:, 2, None] * a for k, a in ((0, columns), (1, rows)))
    sine = (dx * across[:, 0] + dy * across[:, 1]) / np.maximum(np.hypot(dx, dy), 1e-9)
    return np.asarray(np.exp(-0.5 * (sine / AGREEING) ** 2))


def straight_across(cut: BoolArray, points: NDArray[np.float64]) -> int:
    """Which of two vanishing points (2 x 3, in cells) lies more nearly straight across the cells of `cut` (h x w)."""
    cells = np.argwhere(cut)[:, ::-1].astype(np.float64)
    middle = cells.mean(0)
    chord = np.linalg.svd(cells - middle, full_matrices=False)[2][0]
    towards = points[:, :2] - points[:, 2:] * middle
    sine = np.abs(towards[:, 0] * chord[1] - towards[:, 1] * chord[0])
    return int((sine / np.maximum(np.linalg.norm(towards, axis=1), 1e-9)).argmax())
