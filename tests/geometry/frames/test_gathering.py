"""dlama.scene: what frames say of each other, and what is refused (oracles: closed forms, the faults put in)."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from dlama.completion.pipeline import complete
from dlama.errors import InputError, InputTypeError, ShapeError
from dlama.geometry.camera import Camera
from dlama.geometry.frames.gathering import scene
from dlama.geometry.rgbd import RGBD
from worlds import Box, Plane, Sphere, World, moved, noisy_frames

LENS = Camera.from_fov(96, 72, 60)
WORLD = World((Plane((0, 0, 4), (0.1, 0, -1)), Sphere((0.1, 0.1, 2.2), 0.35), Box((-0.9, -0.6, 2.4), (-0.7, 2, 2.6))))
CAMERAS = [moved(LENS, (0, -8 * x, 0), (x, 0.1 * x, 0)) for x in (-0.6, -0.3, 0, 0.3, 0.6)]
frames = partial(noisy_frames, WORLD, CAMERAS)


def test_clean_frames_have_no_gain_and_hardly_noise() -> None:
    """Closed form: the world is exact."""
    many = scene(frames())
    assert many.numbers == (0, 1, 2, 3, 4) and many.gains == ((1.0, 1.0, 1.0),) * 5
    assert np.hypot(many.noise[0], many.noise[1] * 9) < 0.004


def test_noise_is_measured() -> None:
    """Closed form: what was put in, at near and far depth, within a third."""
    many = scene(frames(0.004, 0.002))
    for z in (2.2, 4.0):
        assert np.hypot(many.noise[0], many.noise[1] * z**2) == pytest.approx(np.hypot(0.004, 0.002 * z**2), rel=0.35)


def test_one_frame_is_the_scene_of_one_picture() -> None:
    """Law: one frame, number 0, of unit gain, without noise."""
    one = scene(frames()[:1])
    assert one.numbers == (0,) and len(one.layers) == 1 and one.gains == ((1, 1, 1),) and one.noise == (0, 0)


def test_an_outlier_is_named_and_left_out() -> None:
    """A pose half a metre off; the others keep their numbers."""
    given = frames()
    given[2] = RGBD(given[2].color, given[2].depth, moved(given[2].camera, shift=(0.1, 0, 0.6)))
    with pytest.warns(UserWarning, match="frame 2 contradicts the others"):
        many = scene(given)
    assert many.numbers == (0, 1, 3, 4)


@pytest.mark.parametrize("wrong", [np.linalg.inv, lambda pose: pose @ np.diag([1.0, -1, -1, 1])])
def test_poses_in_a_wrong_convention_are_warned_of(wrong: Callable[[np.ndarray], np.ndarray]) -> None:
    """The fault put in: poses from world to camera, or with OpenGL's axes; right ones raise no warning."""
    away = [moved(LENS, (0, -25 * x, 0), (2 * x, 0.3 * x, 0.2 - x)) for x in (-0.6, -0.3, 0, 0.3, 0.6)]
    room = World(
        (*WORLD.shapes, Plane((0, 1.2, 0), (0, -1, 0)), Plane((0, 0, -6), (0, 0, 1)), Plane((0, -4, 0), (0, 1, 0)))
    )
    right = [room.rgbd(camera) for camera in away]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene(right)
    with pytest.warns(UserWarning) as noted:
        many = scene(
            [RGBD(each.color, each.depth, each.camera.at(wrong(each.camera.world_from_cam))) for each in right]
        )
    assert len(noted) == 1 and many.numbers == (0, 1, 2, 3, 4)
    assert re.search(r"frames contradict one another: \d+% .* `dlama doctor`", str(noted[0].message))


def test_duplicates_are_named_and_left_out() -> None:
    """The same picture from the same place."""
    given = frames()
    with pytest.warns(UserWarning, match="last is frame-1 once more"):
        many = scene([*given, given[1]], names=[*(f"frame-{n}" for n in range(5)), "last"])
    assert many.numbers == (0, 1, 2, 3, 4)


def test_what_cannot_be_a_scene_is_refused() -> None:
    """No frames, a name twice, two sizes, no depth, a function that reads none, no overlap: one line each."""
    given = frames()
    with pytest.raises(InputError, match="frames is empty"):
        scene([])
    with pytest.raises(InputError, match="names has 'left' twice"):
        scene(given[:3], names=["left", "right", "left"])
    small = WORLD.rgbd(Camera.from_fov(48, 36, 60))
    with pytest.raises(ShapeError, match="frame 1 is 48x36 and frame 0 96x72"):
        scene([given[0], small])
    with pytest.raises(InputError, match="frame 1 has no depth at all"):
        scene([given[0], RGBD(given[1].color, np.zeros_like(given[1].depth), given[1].camera)])
    for clip in (None, 3.0):
        with pytest.raises(InputTypeError, match="what reads frame 1 gave a NoneType; an RGBD"):
            complete([given[0], lambda: None], [LENS], filler="telea", clip=clip)  # type: ignore[list-item, return-value]
    away = WORLD.rgbd(moved(LENS, (0, 180, 0)))
    behind = RGBD(away.color, np.full(LENS.hw, 2.0, np.float32), away.camera)
    with pytest.raises(InputError, match="no two of the 2 frames show the same surfaces"):
        scene([given[2], behind])


def test_a_further_frame_has_a_name_of_its_own() -> None:
    """Law: files are called by names; that of its number may be taken."""
    given = frames()
    many = scene(given[:2], names=["frame-0001", "frame-0002"]).with_frame(given[2])
    assert many.names == ("frame-0001", "frame-0002", "frame-0003") and many.numbers == (0, 1, 2)
