"""Stereo folders: real pairs match left to right as their descriptions say; Middlebury folders made of a plane; bad files."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dlama.datasets.frames import StereoTruth
from dlama.datasets.layouts import open_dataset
from dlama.errors import DlamaError, FileError, ShapeError
from dlama.files.rasters.float_files import write_pfm
from dlama.geometry.projection import depth_from_disparity

CALIB = """cam0=[90.5 0 45.75; 0 90.5 37.25; 0 0 1]
cam1=[90.5 0 46.75; 0 90.5 37.25; 0 0 1]
doffs=1
baseline=120
width=96
height=72
"""


def read(path: Path, number: int = 0) -> StereoTruth:
    case = open_dataset(path).of("sii")[number]
    truth = case.load()
    assert isinstance(truth, StereoTruth) and truth.mask_left is None and truth.mask_right is None
    return truth


def warped_difference(truth: StereoTruth) -> np.ndarray:
    """Mean colour difference (levels) at each known pixel whose match lies inside: right column = left - disparity."""
    rows, columns = np.nonzero(truth.disparity_left)
    at = columns - truth.disparity_left[rows, columns]
    inside = (at >= 0) & (at <= truth.left.shape[1] - 1)
    rows, columns, at = rows[inside], columns[inside], at[inside]
    before = np.minimum(np.floor(at).astype(int), truth.left.shape[1] - 2)
    part = (at - before)[:, None]
    right = truth.right[rows, before] * (1 - part) + truth.right[rows, before + 1] * part
    return np.abs(truth.left[rows, columns] - right).mean(1)


def test_motorcycle_matches_left_to_right(data_dir: Path) -> None:
    """Oracle: DATA.md: mean 7.67, median 2.94 levels; depth 2.11 .. 5.02 m; 7.3 % unknown."""
    truth = read(data_dir / "data/motorcycle")
    difference = warped_difference(truth)
    assert difference.mean() == pytest.approx(7.67, abs=0.1) and np.median(difference) == pytest.approx(2.94, abs=0.1)
    assert (truth.disparity_left == 0).mean() == pytest.approx(0.073, abs=5e-4)
    assert truth.metric and truth.disparity_right is None and truth.rig.baseline_m == pytest.approx(0.193001)
    assert truth.rig.left.cx == pytest.approx(311.693) and truth.rig.right.cx == pytest.approx(342.779)
    depth = depth_from_disparity(truth.disparity_left, truth.rig)
    assert [depth[depth > 0].min(), depth.max()] == pytest.approx([2.11, 5.017], abs=5e-3)


@pytest.mark.parametrize(("number", "name", "mean", "median", "left_right"), [
    (0, "Cloth3", 3.98, 2.67, 0.975), (1, "cone", 8.77, 5.33, 0.947),
])  # fmt: skip
def test_cloth_and_cone(data_dir: Path, number: int, name: str, mean: float, median: float, left_right: float) -> None:
    """Oracle: DATA.md's table: colour differences after the warp, and both disparities within 1 px of each other."""
    assert open_dataset(data_dir / "data/stereo").cases[number].scene == name
    truth = read(data_dir / "data/stereo", number)
    difference = warped_difference(truth)
    assert difference.mean() == pytest.approx(mean, abs=0.15)
    assert np.median(difference) == pytest.approx(median, abs=0.4)
    assert truth.disparity_right is not None and not truth.metric
    rows, columns = np.nonzero(truth.disparity_left)
    mine = truth.disparity_left[rows, columns]
    at = np.rint(columns - mine).astype(int)
    inside = at >= 0
    theirs = truth.disparity_right[rows[inside], at[inside]]
    agree = np.abs(theirs - mine[inside])[theirs > 0] <= 1
    assert agree.mean() == pytest.approx(left_right, abs=0.005)


def middlebury(root: Path, both: bool = True) -> Path:
    """A slanted plane, Z = 3 + x / 2: its disparity in closed form in both views; a corner is unknown."""
    root.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(3)
    for name in ("im0.png", "im1.png"):
        Image.fromarray(rng.integers(0, 255, (72, 96, 3), np.uint8)).save(root / name)
    for name, disparity in (("disp0.pfm", plane_disparity(45.75, 0.0)), ("disp1.pfm", plane_disparity(46.75, 0.12))):
        stored = disparity.copy()
        stored[:2, :3] = np.inf
        if both or name == "disp0.pfm":
            write_pfm(root / name, stored)
    (root / "calib.txt").write_text(CALIB)
    return root


def plane_disparity(cx: float, shift_m: float) -> np.ndarray:
    """H x W px as the file counts columns (0.0): ray x = (column - cx) / f from x = shift_m, Z = 3 + x / 2."""
    slope = (np.arange(96) - cx) / 90.5
    depth = (3 + shift_m / 2) / (1 - slope / 2)
    return np.tile(90.5 * 0.12 / depth - 1, (72, 1)).astype(np.float32)


def test_middlebury_folder_of_a_plane(tmp_path: Path) -> None:
    """Oracle: the plane: both disparities and the rig give points on Z = 3 + x / 2, in the left camera's axes."""
    truth = read(middlebury(tmp_path / "Plane"))
    assert truth.metric and truth.disparity_right is not None
    for camera, disparity in ((truth.rig.left, truth.disparity_left), (truth.rig.right, truth.disparity_right)):
        assert (disparity[:2, :3] == 0).all() and (disparity != 0).mean() > 0.99
        depth = depth_from_disparity(disparity, truth.rig)
        columns = np.arange(96) + 0.5
        x = camera.world_from_cam[0, 3] + (columns - camera.cx) / camera.fx * depth
        assert np.abs(depth - 3 - x / 2)[2:].max() < 1e-4


def test_a_folder_of_sets_and_one_without_right_disparity(tmp_path: Path) -> None:
    middlebury(tmp_path / "a", both=False)
    middlebury(tmp_path / "b")
    dataset = open_dataset(tmp_path)
    assert dataset.layout == "stereo" and [case.scene for case in dataset.cases] == ["a", "b"] and not dataset.frames
    assert read(tmp_path, 0).disparity_right is None


def test_bad_folders(tmp_path: Path) -> None:
    root = middlebury(tmp_path)
    write_pfm(root / "disp0.pfm", np.ones((3, 4), np.float32))
    with pytest.raises(ShapeError, match=r"disp0\.pfm: is 4x3 and the left picture 96x72"):
        read(root)
    (root / "disp0.pfm").unlink()
    with pytest.raises(FileError, match=r"has no true disparity; disp0\.pfm or disp0GT\.pfm is expected"):
        open_dataset(root)
    (root / "calib.txt").unlink()
    with pytest.raises(FileError, match=r"calib\.txt: no such file; a stereo folder needs it next to im0\.png"):
        open_dataset(root)


K = [[300, 0, 225], [0, 300, 187], [0, 0, 1]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"disparity_scale": None}, r"disp_left\.png: holds 8-bit numbers; say how many"),
        ({"width": 100}, r"calib\.json: the camera is 100x375 and the picture 450x375"),
        ({"K": K}, r"calib\.json: field 'baseline_m' is missing"),
        ({"K": K, "baseline_m": -1}, r"calib\.json: the baseline is -1 m; a distance"),
    ],
)
def test_bad_calibrations(tmp_path: Path, data_dir: Path, changes: dict[str, Any], message: str) -> None:
    shutil.copytree(data_dir / "data/stereo/cone", tmp_path / "cone")
    path = tmp_path / "cone/calib.json"
    fields = {**json.loads(path.read_text()), **changes}
    path.chmod(0o644)
    path.write_text(json.dumps({name: value for name, value in fields.items() if value is not None}))
    with pytest.raises(DlamaError, match=message):
        read(tmp_path)
