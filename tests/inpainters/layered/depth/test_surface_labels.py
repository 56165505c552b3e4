"""The order of surfaces: which plane may continue behind which inside a hole, as the known pixels say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.layered.depth.cut_objects import CutObjects
from dlama.inpainters.layered.depth.surface_labels import (
    IN_FRONT,
    CoarseView,
    mean_chords,
)
from dlama.inpainters.layered.depth.surfaces import sample_grid
from dlama.perception.planes import SKY, KnownSurfaces
from worlds import Box, Plane, World, moved


def floor_and_wall(kind: HoleType, in_front: Box | None = None) -> tuple[CoarseView, np.ndarray]:
    """A floor that meets a wall, a tall hole across the seam, and rows from the floor down to the wall's last row there."""
    camera = Camera.from_fov(128, 96, 60)
    shapes = (Plane((0, 1, 0), (0, 1, 0)), Plane((0, 0, 5), (0, 0, -1)))
    view = View.from_rgbd(World(shapes if in_front is None else (*shapes, in_front)).rgbd(camera))
    hole = np.zeros(camera.hw, bool)
    hole[20:90, 50:80] = True
    w, view = inverse_depth(view.depth), view.without(hole, kind)
    coarse = sample_grid(view, KnownSurfaces.of(w, view.valid, view.far, 0), 1.0)
    return coarse, World(shapes).trace(camera)[1]


def test_a_wall_does_not_continue_below_the_ground_it_meets() -> None:
    """Closed form: in the hole the wall is out of order where the floor is nearer by IN_FRONT, the floor where the wall is;
    the sky, of which nothing is seen, nowhere; and out of view nobody knows."""
    coarse, number = floor_and_wall(HoleType.OBJECT)
    order = coarse.out_of_order()
    floor, wall = (1 + int(np.bincount(coarse.label[~coarse.hole & (number == n)]).argmax()) for n in (0, 1))
    for back, front in ((wall, floor), (floor, wall)):
        behind = coarse.candidates[front] > IN_FRONT * coarse.candidates[back] + coarse.horizon
        np.testing.assert_array_equal(order[back - 1], behind & coarse.hole)
        assert order[back - 1].sum() > 200
    assert not order[SKY].any()
    assert not floor_and_wall(HoleType.OUT_OF_VIEW)[0].out_of_order().any()


def test_a_wall_seen_above_a_box_is_not_out_of_order_behind_it() -> None:
    """Law: the plane of a box's face continues above the box, where the wall is seen: the wall may stand behind it."""
    coarse, number = floor_and_wall(HoleType.OBJECT, Box((-1.5, 0.3, 3), (1.5, 1, 3.4)))
    wall = 1 + int(np.bincount(coarse.label[~coarse.hole & (number == 1)].clip(0)).argmax())
    faces = [k for k, value in enumerate(coarse.candidates) if k > 1 and abs(value[0, 0] * 3 - 1) < 0.02]
    assert len(faces) == 1
    alone = coarse.candidates[faces[0]] > IN_FRONT * coarse.candidates[wall] + coarse.horizon
    assert (alone & coarse.hole & ~coarse.out_of_order()[wall - 1])[20:40].any()


def grid(inverse_depth: np.ndarray, hole: np.ndarray, label: np.ndarray, planes: tuple[float, ...]) -> CoarseView:
    """A grid by hand whose planes are fronto-parallel: the inverse depths (1/m) that labels 1, 2, ... would give."""
    values = np.stack([np.full(hole.shape, value, np.float32) for value in (0.3, 0, *planes)])
    camera = Camera.from_fov(hole.shape[1], hole.shape[0], 60)
    known = inverse_depth.astype(np.float32), label.astype(np.int8), values
    none = np.zeros(1, np.float32), np.zeros((1, 3), np.float32)
    nothing = CutObjects(np.zeros(hole.shape, np.float32), np.zeros(hole.shape, np.int32), *none)
    return CoarseView(camera, hole, hole, *known, nothing)


def out_of_view(coarse: CoarseView) -> CoarseView:
    """The same grid, whose hole the source's view does not hold."""
    return dataclasses.replace(coarse, hole_in_view=np.zeros_like(coarse.hole))


def wall_with_hole(planes: tuple[float, ...] = (0.25,)) -> CoarseView:
    """A wall 4 m away, of which the upper half is a hole."""
    hole = np.zeros((12, 16), bool)
    hole[:6] = True
    return grid(np.where(hole, 0, 0.25), hole, np.where(hole, -1, 1), planes)


def test_sky_that_only_the_source_saw_continues_here() -> None:
    """Closed form: a view without sky may continue it where the source camera saw some, at the cost of the angle to it; the
    source looks 90 degrees to the right with 60 degrees in view, so from the middle of this view it is 60 degrees to its sky."""
    coarse = out_of_view(wall_with_hole())
    aside = moved(coarse.camera, turn=(0, 90, 0))
    grey = np.full((*aside.hw, 3), 128, np.uint8)
    sky = FillContext.of(Scene((View.from_rgbd(RGBD(grey, np.full(aside.hw, np.inf, np.float32), aside)),)))
    assert not coarse.allowed(FillContext(Law(())))[1].any() and coarse.allowed(sky)[1].all()
    assert coarse.distance_to_known(FillContext(Law(())))[1].min() == 1000
    middle = coarse.distance_to_known(sky)[1][5:7, 7:9].mean()
    assert middle == pytest.approx(coarse.camera.fx * np.radians(60), rel=0.1)


def test_a_wall_has_no_window_onto_the_sky() -> None:
    """Law: a hole that surfaces enclose is no sky, however near some is; one that meets it, or leaves the view, may be."""
    hole, label, w = np.zeros((60, 80), bool), np.ones((60, 80), int), np.full((60, 80), 0.25)
    label[:10], w[:10] = 0, 0
    hole[14:30, 10:20] = hole[5:30, 40:50] = True
    coarse = grid(w, hole, label, (0.25,))
    sky = coarse.allowed(FillContext(Law(())))[1]
    assert not sky[14:30, 10:20].any() and sky[5:30, 40:50].all()
    assert out_of_view(coarse).allowed(FillContext(Law(())))[1][hole].all()


def test_nothing_hangs_in_the_sky() -> None:
    """Closed form: of three walls guessed in a hole full of sky the one that touches neither the known wall nor the border hangs,
    in each of its cells; the sky between them does not."""
    hole, known = np.zeros((40, 60), bool), np.full((40, 60), 0.25, np.float32)
    hole[:30] = True
    label = np.where(hole, SKY, 1)
    for there in (np.s_[20:30, 5:15], np.s_[0:6, 20:30], np.s_[10:18, 40:50]):
        label[there] = 1
    hanging = np.zeros_like(hole)
    hanging[10:18, 40:50] = True
    np.testing.assert_array_equal(grid(known, hole, np.where(hole, -1, 1), (0.25,)).floating(label), hanging)


def test_chords_of_a_pillar_are_its_height_and_width() -> None:
    """Closed form: of two runs of 30 and 10 along each column, each counts by its length: (900 + 100) / 40."""
    there = np.zeros((60, 50), bool)
    there[5:35, 10:14] = there[45:55, 10:14] = True
    assert mean_chords(there) == pytest.approx((25, 4))
    assert mean_chords(np.zeros_like(there)) == (0, 0)


def test_what_stands_out_of_a_wall_a_little_belongs_to_it() -> None:
    """Closed form: at 4 m, what lies on no plane and is 0.16 m before the wall has its label, what is 0.4 m before has none."""
    hole = np.zeros((60, 80), bool)
    hole[:2] = True
    label, w = np.where(hole, -1, 1), np.full(hole.shape, 0.25)
    label[20:30, 10:20] = label[20:30, 50:60] = -1
    w[20:30, 10:20], w[20:30, 50:60] = 1 / 3.84, 1 / 3.6
    got = grid(w, hole, label, (0.25,)).with_relief()
    assert (got[20:30, 10:20] == 1).all() and (got[20:30, 50:60] == -1).all() and (got[hole] == -1).all()
