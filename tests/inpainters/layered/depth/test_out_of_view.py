"""What continues where no camera looked: walls as high and as far as they are seen, table tops along their edges, and nothing
that is small (oracles: closed-form worlds, lines counted by hand, vanishing points of the edges that a table was made with)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.rendering import render
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import inpaint
from dlama.inpainters.layered.depth.out_of_view import (
    CONTINUED_COST,
    CROWN_COST,
    ENDING_COST,
    MOST_HIDDEN,
    PAST,
    CoarseCells,
    PlaneLines,
    above_horizon,
    continue_between,
    ending_cost,
    follow_lines,
)
from dlama.inpainters.layered.depth.plane_edges import align_lines_to_edges
from dlama.inpainters.layered.filler import layered
from worlds import Box, Plane, Shape, World, moved

CAMERA = Camera.from_fov(160, 120, 60)
FLOOR = Plane((0, 1, 0), (0, 1, 0))
FRONT = Box((-40, -1.2, 6), (40, 1, 7))
"""A house front that the picture's border cuts on both sides, with sky above it."""


def turned(shapes: tuple[Shape, ...], yaw: float) -> tuple[View, View, np.ndarray, np.ndarray]:
    """The world seen by CAMERA, shown to a camera turned by yaw: before and after filling; true depth and shape there."""
    world, target = World(shapes), moved(CAMERA, turn=(0, yaw, 0))
    scene = Scene((View.from_rgbd(world.rgbd(CAMERA)),))
    before = render(scene, target)
    return before, inpaint(before, layered, FillContext.of(scene))[0], *world.trace(target)


@pytest.mark.parametrize("yaw", [25, -25])
def test_a_cut_wall_continues_under_a_straight_roof_line(yaw: float) -> None:
    """Closed form: next to the picture the front is the same plane to 1 % and ends at its own top, the sky is above and the floor
    below: of the pixels that the source did not see at most 4 % have another surface, all of them next to borders."""
    before, filled, depth, shape = turned((FLOOR, FRONT), yaw)
    hole = before.hole
    assert (hole & (shape == 1)).sum() > 800 and (hole & np.isposinf(depth)).sum() > 800
    same = (filled.far == np.isposinf(depth)) & (
        filled.far | (np.abs(filled.depth / np.where(filled.far, 1, depth) - 1) < 0.01)
    )
    assert same[hole].mean() > 0.96
    assert same[hole & (shape == 1)].mean() > 0.95


def test_a_world_of_a_thousand_times_the_size_is_filled_alike() -> None:
    """Law: depth scales with the world: a front 6 km away is continued as one 6 m away, to 1e-3, in all but 0.1 % of the hole."""
    large = Plane((0, 1000, 0), (0, 1, 0)), Box((-40e3, -1200, 6000), (40e3, 1000, 7000))
    before, filled, *_ = turned((FLOOR, FRONT), 25)
    other = turned(large, 25)[1]
    with np.errstate(invalid="ignore"):
        same = (filled.far & other.far) | (np.abs(other.depth / 1000 - filled.depth) < 1e-3 * filled.depth)
    assert same[before.hole].mean() > 0.999


@pytest.mark.parametrize("side", [1, -1])
def test_a_cut_pole_ends_before_the_wall_behind_it(side: int) -> None:
    """Law: a pole of which the border leaves 9 px continues for less than 1.6 times that; the wall behind it continues
    beyond, as it truly is (2 %)."""
    pole = Box((min(1.6 * side, 3 * side), -1.1, 3), (max(1.6 * side, 3 * side), 1, 3.3))
    before, filled, *_ = turned((FLOOR, FRONT, pole), 25.0 * side)
    truth = World((FLOOR, FRONT)).trace(before.camera)[0]
    wall = (truth > 5.5) & np.isfinite(truth)
    seen = ~before.hole & (before.depth < 3.6) & (truth > 4.5)
    near = before.hole & (filled.depth < 3.6) & (truth > 4.5)
    assert seen.sum() > 500 and near.sum() < 1.6 * seen.sum()
    beyond = before.hole & wall & ~near
    assert beyond.sum() > 1500
    assert (np.abs(filled.depth[beyond] / truth[beyond] - 1) < 0.02).mean() > 0.95


def out_of_view(w: np.ndarray, label: np.ndarray, hole: np.ndarray, candidates: np.ndarray) -> CoarseCells:
    """Cells by hand, the whole hole out of view."""
    camera = Camera.from_fov(hole.shape[1], hole.shape[0], 60)
    return CoarseCells(camera, hole, np.zeros_like(hole), w, label, candidates)


def half_seen_wall(sky_rows: int = 0) -> CoarseCells:
    """A wall of .25 1/m in 40 x 60 cells below so many rows of sky; the first 24 columns are out of view."""
    w, label = np.full((40, 60), 0.25, np.float32), np.ones((40, 60), np.int8)
    w[:sky_rows], label[:sky_rows] = 0, 0
    candidates = np.stack([np.full(w.shape, value, np.float32) for value in (0.25, 0, 0.25)])
    return out_of_view(w, label, np.indices(w.shape)[1] < 24, candidates)


def test_a_plane_continues_between_two_parts_of_it() -> None:
    """By hand: a wall seen on both sides of a removed object, in rows 10 and below, sky above: it continues in those rows alone,
    and hides the sky there; where it is seen on one side alone nothing is said."""
    w, label = np.full((40, 60), 0.25, np.float32), np.ones((40, 60), np.int8)
    w[:10], label[:10] = 0, 0
    hole = np.zeros(w.shape, bool)
    hole[4:30, 20:40] = hole[15:25, 50:] = True
    candidates = np.stack([np.full(w.shape, value, np.float32) for value in (0.3, 0, 0.25)])
    camera = Camera.from_fov(60, 40, 60)
    cells = CoarseCells(camera, hole, hole, w, label, candidates)
    lines = PlaneLines.of(cells, np.zeros((1, *hole.shape), np.bool_))._replace(along=np.array([[1.0, 0.0, 0.0]]))
    on, hidden = continue_between(lines, cells, np.ones(1, np.bool_), hole)
    between = np.zeros_like(hole)
    between[10:30, 20:40] = True
    np.testing.assert_array_equal(on[2] == 1, between)
    np.testing.assert_array_equal(hidden[1] > 0, between)
    assert not on[:2].any() and not hidden[[0, 2]].any()


def test_a_plane_has_ended_where_the_sky_was_seen_through_it() -> None:
    """By hand: a plane seen in the right half, and in rows 10 to 19 six columns of the hole in which it cannot be: lines from
    left of those look past it there, and find it above and below; its costs are PAST and CONTINUED_COST."""
    cells, past = half_seen_wall(), np.zeros((1, 40, 60), np.bool_)
    past[0, 10:20, 12:18] = True
    on, cost = follow_lines(PlaneLines.of(cells, past), cells, np.ones(1, bool))
    np.testing.assert_allclose(cost[2, 12:18, 2:8], PAST, atol=1e-3)
    assert not on[2, 12:18, 2:8].any() and (on[2, [4, 30], 2:8] > 0.99).all()
    assert (cost[2, [4, 30], 2:8] < 0.6 * CONTINUED_COST).all()


def test_a_strip_of_wall_between_its_ends_hangs_only_where_there_is_sky() -> None:
    """By hand: lines left of columns in which the plane cannot be look past it, but for rows 14 to 23: with sky in the scene the
    plane has ended there, too; in a room it continues."""
    cells, past = half_seen_wall(), np.zeros((1, 40, 60), np.bool_)
    past[0, :14, 12:18] = past[0, 24:, 12:18] = True
    lines = PlaneLines.of(cells, past)
    for sky in (True, False):
        on, cost = follow_lines(lines, cells, np.ones(1, bool), sky)
        np.testing.assert_allclose(cost[2, [4, 34], 2:8], PAST, atol=1e-3)
        assert (on[2, 18, 2:8] > 0.99).all() != sky and (cost[2, 18, 2:8] > 0.99 * PAST).all() == sky


def test_cost_of_a_wall_that_continues_and_of_one_that_has_ended() -> None:
    """Closed form: t cells from a wall seen over 36, below its top, it costs CONTINUED_COST log(1 + t / 36), the sky behind it
    log(1 + 36 / t); at the height of the sky next to it, PAST, and the sky nothing."""
    cells = half_seen_wall(sky_rows=20)
    on, cost = follow_lines(PlaneLines.of(cells, np.zeros((1, 40, 60), np.bool_)), cells, np.ones(1, bool))
    away = 24 - np.arange(4, 20)
    for row in (26, 34):
        np.testing.assert_allclose(on[2, row, 4:20], 1, atol=1e-3)
        np.testing.assert_allclose(cost[2, row, 4:20], CONTINUED_COST * np.log1p(away / 36), atol=0.03)
        np.testing.assert_allclose(cost[1, row, 4:20], np.minimum(np.log1p(36 / away), MOST_HIDDEN), atol=0.2)
    for row in (4, 12):
        np.testing.assert_allclose(cost[2, row, 4:20], PAST, atol=1e-3)
        assert not on[2, row, 4:20].any() and not cost[1, row, 4:20].any()


def test_the_horizon_is_that_of_the_floor() -> None:
    """Closed form: with a floor in sight of a camera turned 20 degrees down, the horizon is the floor's vanishing line."""
    camera = moved(CAMERA, turn=(-20, 0, 0))
    depth = World((Plane((0, 1, 0), (0, 1, 0)),)).trace(camera)[0]
    rows, columns = np.indices(CAMERA.hw)
    design = np.stack([columns.ravel(), rows.ravel(), np.ones(rows.size)], 1)[np.isfinite(depth).ravel()]
    plane = np.linalg.lstsq(design, 1 / depth[np.isfinite(depth)], rcond=None)[0]
    candidates = (plane[0] * columns + plane[1] * rows + plane[2]).astype(np.float32)[None]
    values = np.concatenate([np.zeros((2, *CAMERA.hw), np.float32), candidates])
    floor, none = np.ones(CAMERA.hw, np.int8), np.zeros(CAMERA.hw, np.bool_)
    cells = CoarseCells(CAMERA, none, none, candidates[0], floor, values)
    np.testing.assert_array_equal(above_horizon(cells), candidates[0] < 0)


def test_what_ends_within_the_picture_does_not_continue_outside_it() -> None:
    """Closed form: of planes that are not followed the one that the border cuts costs nothing, one that ends before it
    ENDING_COST; what has no plane nothing where it continues, twice a jump of what lies beyond, ENDING_COST at most."""
    hole, label = np.zeros((60, 100), bool), np.full((60, 100), 1, np.int8)
    hole[:, 60:] = True
    label[20:40, 10:30] = 2
    beyond = np.tile(np.maximum(np.arange(100, dtype=np.float32) - 65, 0), (60, 1))
    not_followed, jump = np.zeros(2, bool), 12.8
    cells = out_of_view(np.full(hole.shape, 0.25, np.float32), label, hole, np.zeros((4, *hole.shape), np.float32))
    assert not ending_cost(dataclasses.replace(cells, hole_in_view=hole), not_followed, beyond, jump).any()
    assert not ending_cost(cells, ~not_followed, beyond, jump)[1:].any()
    loose, sky, cut, ended = ending_cost(cells, not_followed, beyond, jump)
    assert not sky.any() and not cut.any()
    np.testing.assert_array_equal(ended, ENDING_COST * hole.astype(np.float32))
    np.testing.assert_allclose(loose, np.clip(2 * beyond / jump, 0, ENDING_COST) * hole, atol=1e-5)
    assert not loose[:, :66].any() and loose[30, 99] == ENDING_COST
    crown = ending_cost(cells, not_followed, np.full_like(beyond, np.inf), jump)[0]
    np.testing.assert_array_equal(crown, CROWN_COST * hole.astype(np.float32))


WIDE = Camera.from_fov(200, 120, 60)
TURN = np.radians(20)
LONG, SHORT = np.array([np.cos(TURN), 0, np.sin(TURN)]), np.array([-np.sin(TURN), 0, np.cos(TURN)])
TABLE, GROUND = 0.5, 1.2
"""Metres below the camera."""


def table_on_a_floor(tabletop: bool = True, round_one: bool = False) -> tuple[PlaneLines, PlaneLines]:
    """Lines before and after, of a table top (plane 1) turned by 20 degrees on a floor (plane 2), cut by what is out of view at
    the right."""
    rows, columns = np.indices(WIDE.hw)
    x, y = (columns + 0.5 - WIDE.cx) / WIDE.fx, (rows + 0.5 - WIDE.cy) / WIDE.fy
    on_table, on_floor = y / TABLE, y / GROUND
    table = tabletop & inside(x, y, round_one)
    label = np.where(table, 1, np.where(on_floor > 0, 2, -1)).astype(np.int8)
    w = np.where(table, on_table, np.maximum(on_floor, 0)).astype(np.float32)
    candidates = np.stack([np.zeros_like(w), np.zeros_like(w), on_table, on_floor]).astype(np.float32)
    hole = columns >= 150
    cells = CoarseCells(WIDE, hole, np.zeros_like(hole), w, label, candidates)
    lines = PlaneLines.of(cells, np.zeros((len(candidates) - 2, *hole.shape), np.bool_))
    return lines, align_lines_to_edges(lines, cells)


def inside(x: NDArray[np.float64], y: NDArray[np.float64], round_one: bool) -> NDArray[np.bool_]:
    """Where rays meet a table top that lies 0.3 m next to and 1 m before the camera, 1.6 x 0.8 m, or round."""
    z = TABLE / np.maximum(y, 1e-6)
    at = np.stack([x * z - 0.3, np.zeros_like(z), z - 1.5], -1)
    if round_one:
        return np.asarray((y > 0) & (np.linalg.norm(at, axis=-1) < 0.6))
    return np.asarray((y > 0) & (np.abs(at @ LONG) < 0.8) & (np.abs(at @ SHORT) < 0.4))


def test_a_table_continues_along_its_own_edges() -> None:
    """Closed form: K applied to its long and its short side; the floor, beyond which nothing lies, keeps its lines."""
    before, lines = table_on_a_floor()
    assert lines.by_edges.tolist() == [True, False] and not before.by_edges.any()
    for found, direction in ((lines.along[0], LONG), (lines.across[0], SHORT)):
        expected = WIDE.K @ direction - [0.5 * direction[2], 0.5 * direction[2], 0]
        sine = np.linalg.norm(np.cross(found / np.linalg.norm(found), expected / np.linalg.norm(expected)))
        assert sine < 0.02  # a degree
    np.testing.assert_array_equal(lines.along[1], before.along[1])


def test_what_has_no_straight_edges_keeps_its_lines() -> None:
    """Law: a round table and a picture without one."""
    for before, lines in (table_on_a_floor(round_one=True), table_on_a_floor(tabletop=False)):
        assert not lines.by_edges.any()
        np.testing.assert_array_equal(lines.along, before.along)
