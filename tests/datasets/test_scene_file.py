"""A scene.npz as a data set (oracles: the frames that went in, round trips)."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dlama
from dlama.datasets.layouts import open_dataset
from dlama.datasets.posed.view_pairs import NoPairsError
from dlama.errors import FileError, InputError
from dlama.files.scenes.scene_npz import write_npz
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from worlds import Box, Plane, World, moved

LENS = Camera.from_fov(48, 36, 70)
WORLD = World((Plane((0, 0, 4), (0.1, 0, -1)), Box((-0.3, -0.6, 2.4), (0.1, 2, 2.6))))
CAMERAS = [moved(LENS, (0, -14 * n, 0), (0.3 * n, 0, 0)) for n in range(3)]


def frame(camera: Camera) -> RGBD:
    rgbd = WORLD.rgbd(camera)
    depth = rgbd.depth.copy()
    depth[10:14, 20:26] = 0
    return RGBD(rgbd.color, depth, camera)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three frames, completed at one camera."""
    path = tmp_path_factory.mktemp("scene") / "room.npz"
    done = dlama.complete([frame(camera) for camera in CAMERAS], [CAMERAS[1]], filler="telea")
    write_npz(path, done.view, done.scene)
    return path


def test_its_frames_are_those_that_went_in(file: Path) -> None:
    """Depth that was filled is missing again; pairs of frames are cases."""
    found = open_dataset(file)
    assert (found.layout, [one.name for one in found.frames]) == ("scene", ["frame-0000", "frame-0001", "frame-0002"])
    assert found.of("vpi")
    for one, camera in zip(found.frames, CAMERAS):
        read, given = one.load(), frame(camera)
        np.testing.assert_array_equal(read.color, given.color)
        np.testing.assert_array_equal(read.depth, given.depth)
        assert read.camera.same_view_as(camera)


def test_a_scene_of_one_picture_is_no_data_set_and_estimated_depth_no_truth(tmp_path: Path) -> None:
    """Law: one frame has no pair, which is no fault of it; depth that a network gave is reported."""
    guessed = dataclasses.replace(frame(CAMERAS[0]), estimate={"estimator": "mine"})
    done = dlama.complete(guessed, [CAMERAS[0]], filler="telea")
    write_npz(tmp_path / "one.npz", done.view, done.scene)
    with (
        pytest.warns(UserWarning, match="its depth is estimated"),
        pytest.raises(NoPairsError, match="holds 1 frame; two or more"),
    ):
        open_dataset(tmp_path / "one.npz")
    with pytest.warns(UserWarning, match="its depth is estimated"):
        assert "no-overlap" not in {finding.check for finding in dlama.diagnose(tmp_path / "one.npz")}


def test_what_says_nothing_to_a_scene_is_refused(file: Path, tmp_path: Path) -> None:
    """One line each."""
    mask = WORLD.trace(CAMERAS[0])[1] == 1
    done = dlama.complete([frame(camera) for camera in CAMERAS], [CAMERAS[0]], mask={0: mask}, filler="telea")
    write_npz(tmp_path / "gone.npz", done.view, done.scene)
    bad: list[tuple[Path, dict[str, Any], str]] = [
        (file, {"layout": "tum"}, "layout does not apply to a data set of layout scene"),
        (file, {"camera": LENS}, "camera does not apply to a data set of layout scene; it is for tum, 7-scenes"),
        (tmp_path / "none.npz", {}, "no such folder"),
        (tmp_path / "gone.npz", {}, "is a scene without what was removed from it"),
    ]
    for path, options, words in bad:
        with pytest.raises((InputError, FileError), match=words):
            open_dataset(path, **options)


def test_doctor_and_view_take_one(file: Path) -> None:
    """What the doctor understood; a view from the middle frame is that of `complete` (law)."""
    assert dlama.diagnose(file)[-1].what.startswith("room.npz: ")
    scene = dlama.read_scene(file)
    target = dlama.orbit(scene.layers[1].camera, 4.0, 0.0, 2.5)
    views = dlama.view(scene, yaw=4, pivot=2.5, filler="telea"), dlama.complete(scene, [target], filler="telea")
    np.testing.assert_array_equal(views[0].view.color, views[1].view.color)
