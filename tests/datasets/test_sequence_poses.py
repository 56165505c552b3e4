"""Poses of a data set that do not fit its pictures (oracle: the exact poses of a generated world)."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import dlama
from dlama.datasets.sequences.loading import open_frames
from dlama.geometry.camera import Camera
from dlama.geometry.projection import lift, project
from dlama.geometry.rgbd import RGBD
from dlama.worlds.dataset import world
from posed_folders import write_nerfstudio
from worlds import drift

YAWS = (-4, 0, 4, 8)


@pytest.fixture(scope="module")
def exact() -> dict[str, RGBD]:
    made = world(3)
    return {f"img-{n}": made.frame(made.camera(yaw, 192)) for n, yaw in enumerate(YAWS)}


@pytest.fixture(scope="module")
def drifted(exact: dict[str, RGBD]) -> dict[str, Camera]:
    """Their cameras with poses off (`drift`)."""
    rng = np.random.default_rng(1)
    return {name: drift(frame.camera, rng) for name, frame in exact.items()}


@pytest.fixture
def room(exact: dict[str, RGBD], drifted: dict[str, Camera], tmp_path: Path) -> Path:
    """The frames with these poses in nerfstudio's layout; the last one cannot be read."""
    folder = write_nerfstudio(tmp_path / "room", exact, drifted)
    (folder / "depth" / "img-3.png").write_bytes(b"no picture")
    return folder


def apart(cameras: list[Camera], exact: dict[str, RGBD]) -> float:
    """Median px between where points of the first frame are seen by the second camera, and where they should be."""
    first, second = exact["img-0"], exact["img-1"]
    seen, _ = project(lift(dataclasses.replace(first, camera=cameras[0])).points, cameras[1])
    expected, _ = project(lift(first).points, second.camera)
    return float(np.median(np.linalg.norm(seen - expected, axis=1)))


def test_poses_are_corrected(room: Path, exact: dict[str, RGBD], drifted: dict[str, Camera], tmp_path: Path) -> None:
    """Less than a pixel is left, and meta.json says so; with keep_poses the given ones stay."""
    with pytest.warns(UserWarning, match="img-3 is left out"):
        meta = dlama.sequence(room, filler="telea").write(tmp_path / "out", only=["points"])
    corrected = [each.load().camera for each in open_frames(tmp_path / "out")]
    assert apart(corrected, exact) < 1 < apart(list(drifted.values()), exact)
    poses = meta["decisions"]["poses"]
    assert poses["name"] == "aligned" and poses["after_px"] < 1 < poses["before_px"]
    with pytest.warns(UserWarning, match="img-3 is left out"):
        meta = dlama.sequence(room, filler="telea", keep_poses=True).write(tmp_path / "kept", only=["points"])
    for each in open_frames(tmp_path / "kept"):
        np.testing.assert_allclose(each.load().camera.world_from_cam, drifted[each.name].world_from_cam, atol=1e-9)
    assert meta["decisions"]["poses"] == {"name": "given", "reason": "keep_poses"}
