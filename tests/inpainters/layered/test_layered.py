"""The default filler against closed-form worlds: planes and sky continue as they are, the occluder never does."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rendering import render
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import inpaint
from dlama.inpainters.layered.filler import layered
from worlds import Box, Plane, Shape, Sphere, World, moved, shape_shown

CAMERA = Camera.from_fov(160, 120, 60)
FLOOR, WALL = Plane((0, 1, 0), (0, 1, 0)), Plane((0, 0, 4), (0, 0, 1))
DOWN = moved(CAMERA, turn=(-35, 0, 0))


def seen_from(world: World, source: Camera, target: Camera) -> tuple[View, View]:
    """The world's frame at `source`, rendered into `target`; before and after filling."""
    scene = Scene((View.from_rgbd(world.rgbd(source)),))
    before = render(scene, target)
    return before, inpaint(before, layered, FillContext.of(scene))[0]


def without_object(
    background: tuple[Shape, ...], item: Shape, camera: Camera = CAMERA
) -> tuple[View, View, np.ndarray]:
    """The source view without an object, before and after filling, and the true depth behind it."""
    world = World((*background, item))
    source = View.from_rgbd(world.rgbd(camera))
    taken = world.trace(camera)[1] == len(background)
    before = source.without(taken, HoleType.OBJECT)
    context = FillContext.of(Scene((before,), (source.without(~taken, HoleType.NONE),)))
    return before, inpaint(before, layered, context)[0], World(background).trace(camera)[0]


def relative_error(view: View, truth: np.ndarray) -> np.ndarray:
    """|depth - truth| / truth; 0 where both are far, inf where one is."""
    both_far = view.far & np.isposinf(truth)
    with np.errstate(invalid="ignore"):
        return np.where(both_far, 0, np.nan_to_num(abs(view.depth - truth) / truth, nan=np.inf, posinf=np.inf))


@pytest.mark.parametrize("shift", [(0.6, 0, 0), (0, 0, -0.5)], ids=["next_to", "all round"])
def test_a_floor_continues_out_of_view(shift: tuple[float, float, float]) -> None:
    """Closed form: the plane itself, to 1e-3, in over a quarter of the picture that the source never saw."""
    world = World((FLOOR,))
    target = moved(DOWN, shift=shift)
    before, filled = seen_from(world, DOWN, target)
    assert before.hole.mean() > 0.25
    assert relative_error(filled, world.trace(target)[0])[before.hole].max() < 1e-3


@pytest.mark.parametrize("box", [Box((-0.4, 0.2, 2.5), (0.4, 1, 3)), Box((-0.6, 0.1, 2.5), (0.2, 1, 3.2))])
def test_floor_and_wall_meet_behind_a_removed_box(box: Box) -> None:
    """Closed form: both planes to 1e-3, and their crease where it is: only the pixel row at it may take the other plane."""
    before, filled, truth = without_object((FLOOR, WALL), box)
    error = relative_error(filled, truth)
    crease = np.flatnonzero(np.diff(World((FLOOR, WALL)).trace(CAMERA)[1][:, 0]))[0]
    away = before.hole.copy()
    away[crease : crease + 2] = False
    assert before.hole[crease].any() and before.hole[:crease].any() and before.hole[crease + 2 :].any()
    assert error[away].max() < 1e-3
    assert error[before.hole].max() < 0.01
    wrong = shape_shown(filled.color) != World((FLOOR, WALL)).trace(CAMERA)[1]
    assert wrong[away].mean() < 0.02


def hidden_background(world: World, before: View) -> np.ndarray:
    """Disoccluded pixels that truly show something else than the last shape, not next to that shape: at its silhouette a
    pixel may be either, because the source's pixels are as wide."""
    number = world.trace(before.camera)[1]
    item = dilate_mask(number == len(world.shapes) - 1, 1)
    return before.hole & (before.hole_type == HoleType.DISOCCLUDED) & ~item


@pytest.mark.parametrize("side", [-1, 1])
def test_a_wall_is_disoccluded_as_the_wall(side: int) -> None:
    """Closed form: what a box hid of a wall is the wall to 1e-3."""
    world = World((WALL, Box((-0.4, -0.5, 1.8), (0.4, 0.5, 2))))
    target = moved(CAMERA, turn=(0, -10.0 * side, 0), shift=(0.5 * side, 0, 0))
    before, filled = seen_from(world, CAMERA, target)
    hidden = hidden_background(world, before)
    assert hidden.sum() > 500
    assert relative_error(filled, world.trace(target)[0])[hidden].max() < 1e-3


def test_sky_and_wall_continue_behind_a_removed_pole() -> None:
    """Closed form: sky is inf to the pixel, below it the wall and the floor to 1e-3."""
    background = (FLOOR, Box((-9, -0.6, 6), (9, 1, 7)))
    before, filled, truth = without_object(background, Box((-0.3, -1.5, 2.5), (0.3, 1, 2.8)))
    sky = np.isposinf(truth)
    assert (before.hole & sky).sum() > 500 and (before.hole & ~sky).sum() > 500
    np.testing.assert_array_equal(filled.far, sky)
    assert relative_error(filled, truth)[before.hole].max() < 1e-3
    assert (abs(filled.color.astype(int) - (90, 150, 250))[before.hole & sky].max(-1) <= 12).all()


def test_sky_next_to_the_picture_is_sky() -> None:
    """Closed form: a camera turned aside sees sky above the horizon where the source saw nothing; floor is never put there.
    Below the horizon, sky may droop into a few per cent of what is floor (nothing seen says where the floor ends)."""
    world = World((FLOOR,))
    target = moved(CAMERA, turn=(0, 20, 0))
    before, filled = seen_from(world, CAMERA, target)
    truth = world.trace(target)[0]
    sky, floor = (before.hole & (np.isposinf(truth) == far) for far in (True, False))
    assert sky.sum() > 1000 and floor.sum() > 1000
    assert filled.far[sky].all()
    assert filled.far[floor].mean() < 0.1


def test_sky_that_only_the_source_saw_has_its_colour() -> None:
    """Law: where the source camera saw sky and this view shows none, the hole is far, and painted in the sky's mean colour: of
    the difference between two skies at least a quarter is seen there, and nothing elsewhere."""
    wall = View.from_rgbd(World((WALL,)).rgbd(CAMERA))
    upper = np.zeros(CAMERA.hw, bool)
    upper[:60] = True
    view = wall.without(upper, HoleType.OUT_OF_VIEW)
    measured = ((CAMERA, np.where(upper, np.float32(np.inf), wall.depth)),)
    skies = np.array([[10, 200, 30], [190, 20, 210]], np.uint8)
    one, other = (inpaint(view, layered, FillContext(Law(measured), sky.astype(np.float32)))[0] for sky in skies)
    np.testing.assert_array_equal(one.far, upper)
    seen = (one.color.astype(float) - other.color) / (skies[0].astype(float) - skies[1])
    assert seen[:40].min() > 1 / 4 and not seen[60:].any()


@pytest.mark.parametrize("seed", range(4))
def test_the_occluders_depth_never_enters(seed: int) -> None:
    """Law: before a bumpy background at 4.5..6 m stands a ball at 1.8 m; aside, no filled pixel that was hidden is nearer
    than the background can be (2 % of slack), whatever the ball's place."""
    rng = np.random.default_rng(seed)
    bumps = tuple(Sphere((*rng.uniform(-2, 2, 2), 6.0), rng.uniform(0.5, 1.5)) for _ in range(6))
    ball = Sphere((*rng.uniform(-0.3, 0.3, 2), 1.8), 0.3)
    world = World((Plane((0, 0, 6), (0, 0, 1)), *bumps, ball))
    target = moved(CAMERA, shift=(0.3 * (-1) ** seed, 0.1, 0))
    before, filled = seen_from(world, CAMERA, target)
    hidden = hidden_background(world, before)
    assert hidden.sum() > 200
    assert filled.depth[hidden].min() > 0.98 * 4.5


@pytest.mark.parametrize("seed", range(4))
def test_a_removed_objects_depth_never_enters(seed: int) -> None:
    """Law: behind a removed ball the background is nowhere nearer than the nearest background there is (2 % of slack)."""
    rng = np.random.default_rng(seed)
    bumps = tuple(Sphere((*rng.uniform(-2, 2, 2), 6.0), rng.uniform(0.5, 1.5)) for _ in range(6))
    background = (Plane((0, 0, 6), (0, 0, 1)), *bumps)
    before, filled, truth = without_object(background, Sphere((*rng.uniform(-0.3, 0.3, 2), 1.8), 0.3))
    assert before.hole.sum() > 500
    assert filled.depth[before.hole].min() > 0.98 * truth.min()
    assert np.median(relative_error(filled, truth)[before.hole]) < 0.1


def test_planes_are_noted() -> None:
    """Closed form: two planes are in the notes of a corner."""
    before, _, _ = without_object((FLOOR, WALL), Box((-0.4, 0.2, 2.5), (0.4, 1, 3)))
    assert layered(before, FillContext(Law(()))).notes["planes"] == 2
