"""Inverse depth is told from depth (oracle: worlds whose depth is known, and its closed form 1 / z)."""

from __future__ import annotations

import warnings
from pathlib import Path

import cv2
import numpy as np
import pytest

from dlama.errors import DlamaError
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.depth_checks import FEWEST, SHARE, straighter_share
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import Float32Array
from dlama.worlds.dataset import world
from worlds import Plane, World

STREET = World((Plane((0, 1.5, 0), (0, 1, 0)), Plane((0, 0, 9), (0, 0, 1)), Plane((-3, 0, 0), (1, 0, 0))))


def inverse_codes(depth: Float32Array) -> np.ndarray:
    """16-bit inverse depth: the nearest pixel is 60000, far and missing 0."""
    valid = (depth > 0) & (depth < np.inf)
    return np.where(valid, 60000 * depth[valid].min() / np.where(valid, depth, 1), 0).astype(np.uint16)


def test_inverse_depth_is_warned_of(tmp_path: Path) -> None:
    """A floor, a wall and a house: true depth without a word, its inverse with one that says what is expected."""
    depth = STREET.rgbd(Camera.from_fov(256, 192, 80)).depth
    cv2.imwrite(str(tmp_path / "depth.png"), (depth * 1000).astype(np.uint16))
    cv2.imwrite(str(tmp_path / "inverse.png"), inverse_codes(depth))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_depth(tmp_path / "depth.png")
    with pytest.warns(UserWarning, match=r"inverse\.png: looks like inverse depth.*metric depth is expected"):
        read_depth(tmp_path / "inverse.png")


def test_generated_worlds() -> None:
    """No false alarm, and most inverses are found."""
    depths = [world(seed).frame(world(seed).camera(size=160)).depth for seed in range(6)]
    said = []
    for depth in (*depths, *(inverse_codes(each).astype(np.float32) for each in depths)):
        share, votes = straighter_share(depth)
        said.append(share >= SHARE and votes >= FEWEST * depth.size)
    assert not any(said[:6])
    assert sum(said[6:]) >= 4


def test_no_false_alarms_on_real_depth(data_dir: Path) -> None:
    """A Kinect's and a renderer's."""
    files = sorted((data_dir / "data").rglob("*depth*.png"))
    assert len(files) > 10
    for path in files:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                read_depth(path)
            except DlamaError as error:
                assert "depth_scale" in str(error) or "8-bit" in str(error)
