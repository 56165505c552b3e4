"""Alignment of posed frames (oracles: the exact poses of a generated world; the identity where poses fit)."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest

from dlama.geometry.frames.alignment import Features, align_frames, detect_features, estimate_poses, match_all
from dlama.geometry.frames.pose_system import measure_offset
from dlama.geometry.rgbd import RGBD
from dlama.worlds.dataset import world
from worlds import drift

YAWS = (-4, 0, 4)


@pytest.fixture(scope="module")
def exact() -> list[RGBD]:
    made = world(3)
    return [made.frame(made.camera(yaw, 256)) for yaw in YAWS]


@pytest.fixture(scope="module")
def drifted(exact: list[RGBD]) -> list[RGBD]:
    """The same with poses off (`drift`)."""
    rng = np.random.default_rng(1)
    return [dataclasses.replace(frame, camera=drift(frame.camera, rng)) for frame in exact]


def apart(frames: Sequence[RGBD], exact: Sequence[RGBD]) -> float:
    """Median, over pairs, of the pixels between where one frame's points are seen and where they should be."""
    found = [detect_features(frame) for frame in exact]
    _, matches = match_all(found)
    assert matches is not None
    return measure_offset(matches, [frame.camera for frame in frames])


def test_exact_poses_stay(exact: list[RGBD]) -> None:
    """What fits is given back, the same objects."""
    assert all(one is other for one, other in zip(align_frames(exact), exact))


def test_drifted_poses_agree_again(exact: list[RGBD], drifted: list[RGBD]) -> None:
    """Of several pixels under the drifted poses less than one is left; pictures and depths are untouched."""
    aligned = align_frames(drifted)
    assert apart(drifted, exact) > 2
    assert apart(aligned, exact) < 0.8
    for one, other in zip(aligned, exact):
        np.testing.assert_array_equal(one.color, other.color)
        np.testing.assert_array_equal(one.depth, other.depth)
        pose = one.camera.world_from_cam
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-9)


def test_of_many_frames_that_fit_few_are_compared(exact: list[RGBD]) -> None:
    """A sequence to and fro between exact cameras: poses stay, and most frames are never asked for their features."""
    there_and_back = itertools.cycle((0, 1, 2, 1))
    places = [place for place, _ in zip(there_and_back, range(120))]
    known, read = [detect_features(frame) for frame in exact], set[int]()

    def features(place: int) -> Features:
        read.add(place)
        return known[places[place]]

    found = estimate_poses(len(places), features)
    assert found.poses is None and found.before_px < 1
    assert found.decision["poses"] == {
        "name": "given",
        "reason": "they fit the pictures",
        "before_px": round(found.before_px, 2),
        "after_px": round(found.before_px, 2),
    }
    assert len(read) < len(places) / 4


def test_no_frames() -> None:
    assert align_frames([]) == []


def test_functions_that_read_are_aligned_as_frames_are(drifted: list[RGBD]) -> None:
    """The same poses, and the frames are read again."""
    lazy = align_frames([partial(dataclasses.replace, frame) for frame in drifted])
    for read, frame in zip(lazy, align_frames(drifted)):
        np.testing.assert_array_equal(read().camera.world_from_cam, frame.camera.world_from_cam)


def test_frames_without_features_stay(exact: list[RGBD]) -> None:
    """Grey pictures say nothing about poses."""
    grey = [dataclasses.replace(frame, color=np.full_like(frame.color, 128)) for frame in exact[:2]]
    assert all(one is other for one, other in zip(align_frames(grey), grey))
