"""Disparity files: pixels, 0 = missing; against OpenCV and the published scales."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from dlama.errors import DepthError
from dlama.files.rasters.depth import read_disparity, write_disparity_pfm


def test_disparity_there_and_back(tmp_path: Path) -> None:
    disparity = np.array([[0, 1.25, 63.5], [np.nan, 7, np.inf]], np.float32)
    write_disparity_pfm(tmp_path / "d.pfm", disparity)
    assert np.array_equal(np.isinf(cv2.imread(str(tmp_path / "d.pfm"), -1)), [[1, 0, 0], [1, 0, 1]])
    assert read_disparity(tmp_path / "d.pfm").tolist() == [[0, 1.25, 63.5], [0, 7, 0]]


def test_disparity_of_other_kinds(tmp_path: Path) -> None:
    """Oracle: KITTI's value / 256, Middlebury 2003's value / 4."""
    cv2.imwrite(str(tmp_path / "kitti.png"), np.array([[0, 256, 640]], np.uint16))
    cv2.imwrite(str(tmp_path / "cones.png"), np.array([[0, 4, 10]], np.uint8))
    np.savez(tmp_path / "d.npz", disparity=np.array([[np.inf, 1, 2.5]], np.float32), other=np.zeros(1))
    assert read_disparity(tmp_path / "kitti.png").tolist() == [[0, 1, 2.5]]
    assert read_disparity(tmp_path / "cones.png", scale=4).tolist() == [[0, 1, 2.5]]
    assert read_disparity(tmp_path / "d.npz").tolist() == [[0, 1, 2.5]]
    with pytest.raises(DepthError, match=r"8-bit numbers.*disparity_scale"):
        read_disparity(tmp_path / "cones.png")
    np.save(tmp_path / "n.npy", np.array([[-1.0, 2]]))
    np.save(tmp_path / "z.npy", np.array([[np.inf, 0]]))
    with pytest.raises(DepthError, match="1 of 2 disparity values are negative"):
        read_disparity(tmp_path / "n.npy")
    with pytest.raises(DepthError, match="every disparity is missing"):
        read_disparity(tmp_path / "z.npy")
