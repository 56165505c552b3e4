"""Planes on a grid in; lines along their own edges, compared with the vanishing points of the edges they were made with, out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.inpainters.layered.depth.out_of_view import CoarseCells, PlaneLines
from dlama.inpainters.layered.depth.plane_edges import align_lines_to_edges

CAMERA = Camera.from_fov(200, 120, 60)
TURN = np.radians(20)
LONG, SHORT = np.array([np.cos(TURN), 0, np.sin(TURN)]), np.array([-np.sin(TURN), 0, np.cos(TURN)])
TABLE, FLOOR = 0.5, 1.2
"""Metres below the camera."""


def scene(tabletop: bool = True, round_one: bool = False) -> tuple[PlaneLines, PlaneLines]:
    """Lines before and after, of a table top (plane 1) turned by 20 degrees on a floor (plane 2), cut by what is out of view at
    the right."""
    rows, columns = np.indices(CAMERA.hw)
    x, y = (columns + 0.5 - CAMERA.cx) / CAMERA.fx, (rows + 0.5 - CAMERA.cy) / CAMERA.fy
    on_table, on_floor = y / TABLE, y / FLOOR
    table = tabletop & inside(x, y, round_one)
    label = np.where(table, 1, np.where(on_floor > 0, 2, -1)).astype(np.int8)
    w = np.where(table, on_table, np.maximum(on_floor, 0)).astype(np.float32)
    candidates = np.stack([np.zeros_like(w), np.zeros_like(w), on_table, on_floor]).astype(np.float32)
    hole = columns >= 150
    cells = CoarseCells(CAMERA, hole, np.zeros_like(hole), w, label, candidates)
    lines = PlaneLines.of(cells, np.zeros((len(candidates) - 2, *hole.shape), np.bool_))
    return lines, align_lines_to_edges(lines, cells)


def inside(x: NDArray[np.float64], y: NDArray[np.float64], round_one: bool) -> NDArray[np.bool_]:
    """Where rays meet a table top that lies 0.3 m next to and 1 m before the camera, 1.6 x 0.8 m, or round."""
    z = TABLE / np.maximum(y, 1e-6)
    at = np.stack([x * z - 0.3, np.zeros_like(z), z - 1.5], -1)
    if round_one:
        return np.asarray((y > 0) & (np.linalg.norm(at, axis=-1) < 0.6))
    return np.asarray((y > 0) & (np.abs(at @ LONG) < 0.8) & (np.abs(at @ SHORT) < 0.4))


def test_a_table_goes_on_along_its_own_edges() -> None:
    """Closed form: K applied to its long and its short side; the floor, beyond which nothing lies, keeps its lines."""
    before, lines = scene()
    assert lines.by_edges.tolist() == [True, False] and not before.by_edges.any()
    for found, direction in ((lines.along[0], LONG), (lines.across[0], SHORT)):
        wanted = CAMERA.K @ direction - [0.5 * direction[2], 0.5 * direction[2], 0]
        sine = np.linalg.norm(np.cross(found / np.linalg.norm(found), wanted / np.linalg.norm(wanted)))
        assert sine < 0.02  # a degree
    np.testing.assert_array_equal(lines.along[1], before.along[1])


def test_what_has_no_straight_edges_keeps_its_lines() -> None:
    """Law: a round table and a picture without one."""
    for before, lines in (scene(round_one=True), scene(tabletop=False)):
        assert not lines.by_edges.any()
        np.testing.assert_array_equal(lines.along, before.along)
