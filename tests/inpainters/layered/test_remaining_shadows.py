"""Shadows that stay when an object is removed: nothing is painted with them, and what is painted begins as dark as they are."""

from __future__ import annotations

import numpy as np

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.layered.remaining_shadows import find_remaining_shadow
from dlama.perception.resampling import shrink_rgbd
from worlds import Plane, World

CAMERA = Camera.from_fov(160, 120, 60)
LIT, DARK = 170, 90
THING = np.s_[50:80, 60:100]
NOTHING = Law(())


def ground_without_object(*shadows: tuple[slice, slice], grey: int = DARK) -> tuple[View, np.ndarray]:
    """A floor of one grey of which a box is a hole, darker (grey) under the given shadows; and which of it is dark."""
    world = World((Plane((0, 0, 4), (0, 0.5, -1)),)).rgbd(CAMERA)
    dark = np.zeros(CAMERA.hw, bool)
    for shadow in shadows:
        dark[shadow] = True
    grey = np.where(dark, grey, LIT) + np.random.default_rng(0).integers(-4, 5, CAMERA.hw)
    color = np.repeat(grey[..., None], 3, 2).astype(np.uint8)
    view = View.from_rgbd(RGBD(color, world.depth, CAMERA))
    hole = np.zeros(CAMERA.hw, bool)
    hole[THING] = True
    return view.without(hole, HoleType.OBJECT), dark & ~hole


NEXT_TO = np.s_[74:92, 60:110]


def test_a_shadow_next_to_the_object_is_found() -> None:
    """Closed form: the dark pixels but for their rim, and nothing 3 px beyond it; none where nothing is dark, and none that
    lies apart from the object. Law: what is as dark farther off is a pattern of the ground; what hides part of a view from
    elsewhere was not removed."""
    view, dark = ground_without_object(NEXT_TO)
    label = np.ones(CAMERA.hw, np.int8)
    found = find_remaining_shadow(view, label, NOTHING)
    assert found[dark].mean() > 0.85 and not (found & ~dilate_mask(dark, 3)).any() and not (found & view.hole).any()
    assert not find_remaining_shadow(ground_without_object()[0], label, NOTHING).any()
    assert not find_remaining_shadow(ground_without_object(np.s_[100:110, 20:60])[0], label, NOTHING).any()
    tiles = [np.s_[row : row + 12, column : column + 16] for row in (52, 80, 104) for column in range(4, 160, 40)]
    assert not find_remaining_shadow(ground_without_object(*tiles, NEXT_TO)[0], label, NOTHING).any()
    other = view.without(view.hole, HoleType.DISOCCLUDED)
    assert not find_remaining_shadow(other, label, NOTHING).any()


def test_black_is_no_shadow() -> None:
    """Law: a shadow keeps a share of the light, so what has a hundredth of it is painted black, as a screen and its frame are;
    a seventh of the light (8-bit values by gamma 2.2) is a shadow still."""
    for light, found in ((1 / 7, True), (1 / 100, False)):
        view, dark = ground_without_object(NEXT_TO, grey=round(LIT * light ** (1 / 2.2)))
        assert find_remaining_shadow(view, np.ones(CAMERA.hw, np.int8), NOTHING)[dark].any() == found


def test_what_lies_far_behind_the_object_or_in_estimated_depth_is_no_shadow() -> None:
    """Law: a dark window far behind a removed object is not its shadow, what lies at its depth is; estimated depth tells
    neither."""
    view, dark = ground_without_object(NEXT_TO)
    label = np.ones(CAMERA.hw, np.int8)
    ground = float(np.median(view.depth[dark]))
    for depth, found in ((ground, True), (ground / 4, False)):
        item = View.from_rgbd(RGBD(view.color, np.full(CAMERA.hw, depth, np.float32), CAMERA))
        law = Law.of(Scene((view,), (item.without(~view.hole, HoleType.NONE),)))
        assert find_remaining_shadow(view, label, law)[dark].any() == found
    guessed = view.with_planes(origin=np.where(view.hole, view.origin, np.uint8(Origin.ESTIMATED)))
    assert not find_remaining_shadow(guessed, label, NOTHING).any()


def test_how_much_of_it_stays_is_noted() -> None:
    """Closed form: the drawn pixels that the mask leaves, but for a rim; none where nothing is dark."""
    for shadows, least, most in (((NEXT_TO,), 0.8, 1.25), ((), 0.0, 0.0)):
        view, dark = ground_without_object(*shadows)
        frame = RGBD(view.color, view.depth, CAMERA)
        done = dlama.complete(frame, [CAMERA], mask=view.hole, filler="telea", dilate=0)
        assert least * dark.sum() <= done.meta["notes"]["remaining_shadow_px"] <= most * dark.sum()


def test_as_much_of_it_stays_from_elsewhere() -> None:
    """Law: what is noted is of the frame that the object was removed from. The mask of the example holds its shadow."""
    street = dlama.example()
    rgbd = dlama.read_rgbd(street / "street.jpg", street / "depth.png", fov=90)
    mask = dlama.read_mask(street / "mask.png")[::2, ::2]
    for yaw in (0, 10):
        done = dlama.remove(shrink_rgbd(rgbd, (256, 256)), mask, yaw=yaw, filler="telea")
        assert done.meta["notes"]["remaining_shadow_px"] == 0
