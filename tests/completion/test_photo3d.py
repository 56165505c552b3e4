"""3-D photos (oracles: the definition of an open pixel, the measured pixels themselves, a closed-form world)."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest
from small_street import MASK, street

from dlama.completion import photo3d as module
from dlama.completion.photo3d import photo3d
from dlama.completion.verbs import remove
from dlama.errors import DepthError, InputError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View

LARGER_THAN_3 = np.ones((4, 4), np.uint8)


@pytest.fixture(scope="module")
def done() -> module.Photo3D:
    """The small street, which has sensor holes, with the default box."""
    return photo3d(street(), filler="telea")


def test_no_camera_of_the_box_sees_a_hole(done: module.Photo3D) -> None:
    """Of 40 cameras drawn from the box none has 0.2 % of open pixels, or an open square of 4 px."""
    for camera in done.box.sample(40):
        hole = render(done.scene, camera, types=False, fine=False).hole
        assert hole.mean() < 0.002
        assert not cv2.erode(hole.astype(np.uint8), LARGER_THAN_3, borderValue=0).any()


def test_wide_cameras_fill_what_is_out_of_view(done: module.Photo3D) -> None:
    """Law: of what an object hides they see slivers, which cameras from the side fill as a whole."""
    for fill in done.scene.fills[: module.WIDE_CAMERAS]:
        assert fill.camera.width > street().camera.width
        assert set(np.unique(fill.load().hole_type)) == {HoleType.NONE.value, HoleType.OUT_OF_VIEW.value}


def test_measured_pixels_stay(done: module.Photo3D) -> None:
    """At the source camera colour and depth that were measured come back bit for bit."""
    given = street()
    view = render(done.scene, done.box.camera)
    assert (view.color == given.color).all()
    assert (view.depth[~given.missing] == given.depth[~given.missing]).all()
    assert not view.hole.any()


def test_meta_says_what_was_done(done: module.Photo3D) -> None:
    """The box, and as many cameras as shares of holes."""
    reported = done.meta["photo3d"]
    assert reported["angle_deg"] == pytest.approx(done.box.angle, abs=1e-3) and reported["hidden_step"] == 1
    assert 1 <= len(reported["filled_cameras"]) <= len(done.meta["hole_share"]) and done.meta["filler"] == "telea"
    assert reported["open_share"] <= module.ENOUGH or len(reported["filled_cameras"]) == module.MOST_CAMERAS


def test_hidden_layers_of_large_pictures_are_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond HIDDEN_PIXELS the source stays as it is, and fills have a fraction of its size."""
    monkeypatch.setattr(module, "HIDDEN_PIXELS", 128 * 96 // 4)
    given = street()
    large = photo3d(given, filler="telea")
    assert large.meta["photo3d"]["hidden_step"] == 2
    view = render(large.scene, large.box.camera)
    assert (view.color == given.color).all() and (view.depth[~given.missing] == given.depth[~given.missing]).all()
    assert all(fill.camera.fx == pytest.approx(given.camera.fx / 2) for fill in large.scene.fills)
    assert max(render(large.scene, camera, types=False).hole.mean() for camera in large.box.sample(10)) < 0.002


def test_a_removed_object_stays_away() -> None:
    """A scene without its ball: at home the ball's pixels show what lies behind it (oracle: its own depth)."""
    without = remove(street(), MASK, filler="telea")
    turned = photo3d(without.scene, angle=3, distance=0.02, filler="telea")
    at_home = render(turned.scene, turned.box.camera)
    assert (at_home.depth[MASK] > street().depth[MASK]).all()
    assert len(turned.scene.removals) == 1


def test_what_is_no_box_or_no_depth_is_refused() -> None:
    """Angles and distances out of range, a picture without any depth."""
    for wrong in ({"angle": -1.0}, {"angle": 60.0}, {"distance": 2.0}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            photo3d(street(), filler="telea", **wrong)
    given = street()
    empty = RGBD(given.color, np.full_like(given.depth, np.inf), given.camera)
    with pytest.raises(DepthError, match="nothing to turn about"):
        photo3d(empty)


def test_a_flat_wall_has_a_box() -> None:
    """A wall across has no parallax, so the box has its largest angle."""
    camera = Camera.from_fov(64, 48, 60)
    wall = RGBD(np.full((48, 64, 3), 90, np.uint8), np.full((48, 64), 2, np.float32), camera)
    done = photo3d(wall, filler="telea")
    assert done.box.angle == pytest.approx(12) and done.box.pivot == pytest.approx(2)
    assert dataclasses.is_dataclass(done) and "12 degrees" in repr(done)
    assert isinstance(done.scene.frames[0], View)


@pytest.mark.parametrize("fov", [150, 179])
def test_a_very_wide_lens(fov: float) -> None:
    """Cameras of the box see behind the one in its middle. Law: what was measured comes back; pytest makes a warning of an empty
    mean an error."""
    color = np.random.default_rng(1).integers(0, 255, (48, 64, 3)).astype(np.uint8)
    depth = np.where(np.arange(64) < 20, 3, 5) * np.ones((48, 1), np.float32)
    given = RGBD(color, depth, Camera.from_fov(64, 48, fov=fov))
    wide = photo3d(given)
    view = render(wide.scene, wide.box.camera)
    assert (view.color == color).all() and (view.depth == given.depth).all()
