"""Checks of poses (oracle: the corruption that was put in; good inputs have none)."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

import dlama
from corruptions import POSES, moved
from dlama.datasets.layouts import open_dataset
from dlama.perception.diagnosis.finding import Finding
from dlama.perception.diagnosis.poses import check_poses, mean_fit, reorder_quaternion, shrink
from dlama.worlds.layouts.random_scene import build
from dlama.worlds.world import World
from marks import first_quick

needs_data = pytest.mark.skipif("DLAMA_DATA" not in os.environ, reason="needs DLAMA_DATA")


@cache
def world(seed: int) -> World:
    return build(seed, None, ())


@cache
def hand_held(seed: int) -> tuple[dlama.RGBD, ...]:
    """A camera that moves and turns about all axes: on a level orbit some conventions do not differ."""
    made, rng, frames = world(seed), np.random.default_rng(seed), []
    for number in range(4):
        camera = dlama.orbit(made.camera(0, 160), 8.0 * number, 5.0 * number)
        roll = np.eye(4)
        roll[:3, :3] = cv2.Rodrigues(rng.normal(0, 0.05, 3) + np.array((0, 0, 0.08 * number)))[0]
        roll[:3, 3] = rng.normal(0, 0.05, 3)
        frames.append(made.frame(camera.at(camera.world_from_cam @ roll)))
    return tuple(frames)


def poses_of(frames: Sequence[dlama.RGBD]) -> list[Finding]:
    return check_poses(list(pairwise(shrink(frame) for frame in frames)), "scene")


@pytest.mark.parametrize("seed", first_quick([3, 12]))
def test_good_poses(seed: int) -> None:
    assert poses_of(hand_held(seed)) == []
    assert poses_of(hand_held(seed)[:1]) == []


@pytest.mark.parametrize("name", POSES)
def test_conventions(name: str) -> None:
    spoil, expected = POSES[name]
    assert [each.check for each in poses_of(moved(hand_held(3), spoil))] == [expected]


def test_quaternions_in_another_order() -> None:
    """Oracle: a quarter turn about z, (0, 0, s, s), is one about x with z put first; in its own order it comes back."""
    pose = np.eye(4)
    pose[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    turned = reorder_quaternion(pose, (2, 0, 1, 3))
    assert np.allclose(turned[:3, :3], [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert np.allclose(reorder_quaternion(pose, (0, 1, 2, 3)), pose)


def test_exposure_between_frames_is_a_note() -> None:
    frames = [
        dlama.RGBD((each.color * (1.0, 0.6)[number % 2]).astype(np.uint8), each.depth, each.camera)
        for number, each in enumerate(hand_held(3))
    ]
    assert [(each.check, each.severity) for each in poses_of(frames)] == [("exposure", "note")]


def link_kitchen(folder: Path, times: float = 1.0) -> Path:
    """A listing of six frames of a real sequence, translations multiplied."""
    source = Path(os.environ["DLAMA_DATA"]) / "data" / "kitchen_sequence"
    listing = json.loads((source / "transforms.json").read_text("utf-8"))
    listing["frames"] = listing["frames"][20:26]
    for frame in listing["frames"]:
        for row in frame["transform_matrix"][:3]:
            row[3] *= times
        for key in ("file_path", "depth_file_path"):
            frame[key] = str(source / frame[key])
    (folder / "transforms.json").write_text(json.dumps(listing), "utf-8")
    return folder


@pytest.mark.slow
@needs_data
def test_a_real_sequence(tmp_path: Path) -> None:
    (finding,) = dlama.diagnose(link_kitchen(tmp_path))
    assert finding.check == "understood" and "layout nerfstudio, 6 frames" in finding.what
    frames = [frame.load() for frame in open_dataset(tmp_path).frames[:3]]
    for expected, spoil in {check: spoil for spoil, check in POSES.values()}.items():
        assert [each.check for each in poses_of(moved(frames, spoil))] == [expected]


@needs_data
@pytest.mark.parametrize("name", ["motorcycle", "stereo", "bin_removal"])
def test_real_pairs_and_removals_are_fine(name: str) -> None:
    found = dlama.diagnose(Path(os.environ["DLAMA_DATA"]) / "data" / name)
    assert [each.check for each in found if each.severity == "fault"] == []


@needs_data
def test_poses_of_a_data_set_that_do_not_meet(tmp_path: Path) -> None:
    """Oracle: translations written in millimetres; then no two frames overlap, and the frames are looked at all the same."""
    found = dlama.diagnose(link_kitchen(tmp_path, 1000))
    assert [each.check for each in found] == ["no-overlap", "pose-scale", "understood"]


def test_what_says_nothing_to_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(dlama.InputError, match="second"):
        dlama.diagnose(tmp_path, "depth.png")
    (finding,) = dlama.diagnose(tmp_path)
    assert finding.check == "reading"


def test_poses_far_from_the_origin_are_checked() -> None:
    """Geo-referenced metres: a thousand times as far no camera may stand, and that convention is none."""
    frames = []
    for yaw in (0.0, 5.0, 10.0):
        frame = world(3).frame(world(3).camera(yaw, 96))
        pose = frame.camera.world_from_cam.copy()
        pose[:3, 3] += 4e5, 0, 5.5e6
        frames.append(dlama.RGBD(frame.color, frame.depth, frame.camera.at(pose)))
    assert poses_of(frames) == []
    assert (
        mean_fit(
            list(pairwise(shrink(frame) for frame in frames)),
            lambda pose: pose @ np.diag([1, 1, 1, 1]) + np.eye(4, k=3) * 1e12,
        )
        == 0
    )
