"""Hole types against closed-form worlds: why each uncovered pixel is uncovered, known from where everything stands."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.holes import dilate_square, erode_square
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rendering import MODES, Mode, render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from worlds import Box, Plane, Sphere, World, moved, pixels_of, points_of, rays_of

SOURCE = Camera.from_fov(120, 90, 60)
WALL = Plane((0, 0, 6), (0, 0, -1))
BOX = Box((-0.5, -0.6, 3), (0.5, 0.6, 3.5))
SPHERE = Sphere((0, 0, 3.5), 0.8)
WORLDS = {"box": World((BOX, WALL)), "sphere": World((SPHERE, WALL))}
TARGETS = {
    "aside": moved(SOURCE, shift=(0.8, 0, 0)),
    "yaw 20": orbit(SOURCE, 20),
    "yaw -30 pitch 15": orbit(SOURCE, -30, 15),
    "back": moved(SOURCE, shift=(-0.5, 0.2, -1.5)),
}
modes = pytest.mark.parametrize("mode", MODES)
targets = pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS.keys())


def on_wall(target: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Source x, y of the wall behind every target pixel (nan where there is none, or behind the source)."""
    depth, _ = World((WALL,)).trace(target)
    finite = np.isfinite(depth)
    x, y, z = pixels_of(SOURCE, points_of(target, np.where(finite, depth, 1.0)))
    return np.where(finite & (z > 0), x, np.nan), np.where(finite & (z > 0), y, np.nan)


def in_frustum(target: Camera, margin: float = 0) -> np.ndarray:
    """H x W of the target, True where the wall there lies within the source picture (shrunk by `margin` pixels)."""
    x, y = on_wall(target)
    return (x >= margin) & (y >= margin) & (x < SOURCE.width - margin) & (y < SOURCE.height - margin)


def looked_up(mask: np.ndarray, target: Camera) -> np.ndarray:
    """A mask of the source picture at the wall's points of every target pixel, False outside."""
    x, y = on_wall(target)
    inside = in_frustum(target)
    return inside & mask[np.where(inside, y, 0).astype(int), np.where(inside, x, 0).astype(int)]


def has(view: View, kind: HoleType) -> np.ndarray:
    """H x W, True at holes of a type."""
    return view.hole_type == kind


@targets
@modes
@pytest.mark.parametrize("name", WORLDS)
def test_hidden_and_outside(name: str, mode: Mode, target: Camera) -> None:
    """Closed form: a wall pixel that the source does not see is DISOCCLUDED within its picture, else OUT_OF_VIEW.

    Both but for 1.5 px at their rims; at the rim of a sphere a flying pixel may lie in the hole. Law: holes alone have types, all
    of them one; a surface drawing has no cracks, a full frame no SENSOR hole.
    """
    world = WORLDS[name]
    view = render(world.rgbd(SOURCE), target, mode)
    np.testing.assert_array_equal(view.hole_type > 0, view.hole)
    others = {HoleType.SENSOR, HoleType.OBJECT} | ({HoleType.CRACK} if mode == "surface" else set())
    assert not np.isin(view.hole_type, sorted(others)).any()
    sees_wall = erode_square(world.trace(target)[1] == 1, 3)
    hidden = erode_square(~world.seen_by(SOURCE, target) & in_frustum(target), 3) & sees_wall
    outside = erode_square(~in_frustum(target), 3) & sees_wall
    assert hidden.sum() > 50 and outside.sum() > 50
    inner = hidden & ~has(view, HoleType.FLYING)
    assert inner.sum() > 0.9 * hidden.sum()
    np.testing.assert_array_equal(view.hole_type[inner], HoleType.DISOCCLUDED)
    np.testing.assert_array_equal(view.hole_type[outside], HoleType.OUT_OF_VIEW)


@targets
@modes
def test_sensor_holes_move_with_the_wall(mode: Mode, target: Camera) -> None:
    """Closed form: where the wall's point lies in a patch without depth the pixel is a SENSOR hole, but for 1.5 px."""
    frame = World((WALL,)).rgbd(SOURCE)
    patch = np.zeros(SOURCE.hw, np.bool_)
    patch[30:50, 40:70] = True
    view = render(RGBD(frame.color, np.where(patch, 0, frame.depth).astype(np.float32), SOURCE), target, mode)
    must, may = looked_up(erode_square(patch, 3), target), looked_up(dilate_square(patch, 3), target)
    assert must.sum() > 100
    np.testing.assert_array_equal(view.hole_type[must], HoleType.SENSOR)
    assert not (has(view, HoleType.SENSOR) & ~may).any()


@targets
@modes
def test_what_a_removed_object_hid_is_an_object_hole(mode: Mode, target: Camera) -> None:
    """Closed form: the wall behind a removed box is OBJECT, from wherever one looks; the box itself does not show."""
    world = WORLDS["box"]
    source = View.from_rgbd(world.rgbd(SOURCE))
    box = world.trace(SOURCE)[1] == 0
    scene = Scene((source.without(box, HoleType.OBJECT),), (source.without(~box, HoleType.NONE),))
    view = render(scene, target, mode)
    must = looked_up(erode_square(box, 3), target)
    assert must.sum() > 100
    assert view.hole[must].all()
    np.testing.assert_array_equal(view.hole_type[must], HoleType.OBJECT)
    beyond = ~looked_up(dilate_square(box, 3), target) & in_frustum(target)
    assert not (has(view, HoleType.OBJECT) & beyond).any()
    points = points_of(target, np.where(view.valid, view.depth, 6).astype(np.float64))
    assert (WALL.distance(points)[view.valid] < 0.1).all()


@modes
def test_what_hid_the_sky_leaves_a_disocclusion(mode: Mode) -> None:
    """Closed form: a sphere under the sky, seen from aside: the sky that it hid is DISOCCLUDED; nothing else is a hole.

    Beyond the source's picture the sky is OUT_OF_VIEW.
    """
    world = World((SPHERE,))
    target = moved(SOURCE, (0, 4, 0), (-1.5, 0, 0))
    view = render(world.rgbd(SOURCE), target, mode)
    x, y, z = pixels_of(SOURCE, SOURCE.world_from_cam[:3, 3] + rays_of(target))
    inside = (z > 0) & (x >= 0) & (y >= 0) & (x < SOURCE.width) & (y < SOURCE.height)
    behind = world.cast(SOURCE.world_from_cam[:3, 3], rays_of(target))[1] == 0
    empty = erode_square(world.trace(target)[1] == -1, 3)
    hidden = empty & erode_square(behind & inside, 3) & ~has(view, HoleType.FLYING)
    assert hidden.sum() > 500 and (empty & ~inside).sum() > 200
    np.testing.assert_array_equal(view.hole_type[hidden], HoleType.DISOCCLUDED)
    assert not view.hole[empty & erode_square(~behind & inside, 3)].any()
    np.testing.assert_array_equal(view.hole_type[empty & erode_square(~inside, 3)], HoleType.OUT_OF_VIEW)


def test_a_second_layer_closes_what_it_sees() -> None:
    """Law: with the frame of another camera in the scene, only what neither sees is a hole."""
    world = WORLDS["box"]
    other = moved(SOURCE, shift=(1.6, 0, 0))
    target = TARGETS["aside"]
    views = [View.from_rgbd(world.rgbd(camera)) for camera in (SOURCE, other)]
    both = render(Scene((views[0],), fills=(views[1],)), target)
    alone = [render(view, target).hole for view in views]
    np.testing.assert_array_equal(both.hole, alone[0] & alone[1])
    assert both.hole.sum() < 0.5 * min(hole.sum() for hole in alone)


@modes
def test_a_frame_without_any_depth_is_one_sensor_hole(mode: Mode) -> None:
    """Law: nothing measured: at home all SENSOR, elsewhere all hole, and no crash."""
    frame = RGBD(np.full((6, 8, 3), 9, np.uint8), np.zeros((6, 8), np.float32), Camera.from_fov(8, 6, 60))
    np.testing.assert_array_equal(render(frame, frame.camera, mode).hole_type, HoleType.SENSOR)
    elsewhere = render(frame, moved(frame.camera, (0, 5, 0), (0.1, 0, 0)), mode)
    assert elsewhere.hole.all() and (elsewhere.hole_type > 0).all()
