"""Edges of level planes: known cells in; planes whose lines run along their own straight edges out.

A wall continues along its horizontals. A table top has no such direction except its edges, and those continue straight.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.holes import dilate_mask, morphological_close, morphological_open, square
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.layered.depth.out_of_view import (
    CUT_CELLS,
    LEVEL,
    CoarseCells,
    PlaneLines,
    estimate_up,
    matrix_of_cells,
    normals,
)

WIDE = 5
"""Side, in cells, of the square that a hole next to a plane must hold to be a dis-occlusion; smaller ones are sensor holes."""


def align_lines_to_edges(lines: PlaneLines, cells: CoarseCells) -> PlaneLines:
    """The lines, with those of level planes that the border cuts turned along their own edges."""
    hole, unseen, w = cells.hole, cells.unseen, cells.inverse_depth
    normal = normals(lines.planes, cells.camera)
    level = np.abs(normal @ estimate_up(normal, cells.plane_cells)) > LEVEL
    by_edges, points = lines.by_edges.copy(), [lines.along.copy(), lines.across.copy()]
    for k in np.flatnonzero(level):
        there = morphological_close(~hole & (cells.label == k + 1), square(WIDE))
        cut = there & cells.near_unseen & ~hole
        beyond = ~hole & (1.06 * w < cells.candidates[k + 2])
        if cut.sum() < CUT_CELLS or beyond.sum() < 0.05 * there.sum():  # nothing lies beyond the ground
            continue
        # where the picture's border cuts a plane it has no outline
        outline = there & ~cells.near_unseen & dilate_mask(beyond | morphological_open(hole & ~unseen, square(WIDE)), 1)
        found = edge_directions(there, outline, normal[k], cells.camera)
        if found is None:
            continue
        first = straight_across(cut, found)
        points[0][k], points[1][k], by_edges[k] = found[first], found[1 - first], True
    return lines._replace(along=points[0], across=points[1], by_edges=by_edges)


def edge_directions(
    there: BoolArray, outline: BoolArray, normal: NDArray[np.float64], camera: Camera
) -> NDArray[np.float64] | None:
    """2 x 3 vanishing points, homogeneous, in cells, of two perpendicular directions in a plane along which most of its outline
    runs; None if there are none.

    there: h x w, the cells of the plane; outline: h x w, those at its end; normal: 3, unit, camera axes.
    """
    rows, columns = np.nonzero(outline)
    if len(rows) < 30:
        return None
    blurred = cv2.GaussianBlur(there.astype(np.float32), (0, 0), 2.0)
    slope = np.stack([cv2.Sobel(blurred, cv2.CV_32F, *way)[rows, columns] for way in ((1, 0), (0, 1))], 1)
    across = np.asarray(slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9), np.float32)
    first = np.cross(normal, [0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    turn = np.arange(90)[:, None] * (np.pi / 2 / 90)
    one, other = np.cos(turn) * first + np.sin(turn) * second, np.cos(turn) * second - np.sin(turn) * first
    K = matrix_of_cells(camera)
    points = np.stack([one @ K.T, other @ K.T], 1)
    score = np.maximum(*(agreement(points[:, k], rows, columns, across) for k in (0, 1))).mean(1)
    best = int(score.argmax())
    return points[best] if score[best] >= 0.4 else None  # table tops have .48 to .73, seats and fragments below .35


def agreement(
    points: NDArray[np.float64], rows: NDArray[np.intp], columns: NDArray[np.intp], across: Float32Array
) -> NDArray[np.float64]:
    """T x N agreement, 0..1, of an outline at N cells (normals `across`: N x 2, x and y) with T vanishing points (T x 3)."""
    dx, dy = (points[:, k, None] - points[:, 2, None] * a for k, a in ((0, columns), (1, rows)))
    sine = (dx * across[:, 0] + dy * across[:, 1]) / np.maximum(np.hypot(dx, dy), 1e-9)
    return np.asarray(np.exp(-0.5 * (sine / np.radians(4.0)) ** 2))


def straight_across(cut: BoolArray, points: NDArray[np.float64]) -> int:
    """Which of two vanishing points (2 x 3, in cells) is more nearly perpendicular to the cells of `cut` (h x w)."""
    cells = np.argwhere(cut)[:, ::-1].astype(np.float64)
    middle = cells.mean(0)
    chord = np.linalg.svd(cells - middle, full_matrices=False)[2][0]
    towards = points[:, :2] - points[:, 2:] * middle
    sine = np.abs(towards[:, 0] * chord[1] - towards[:, 1] * chord[0])
    return int((sine / np.maximum(np.linalg.norm(towards, axis=1), 1e-9)).argmax())
