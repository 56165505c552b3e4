"""Replica as NICE-SLAM renders it: a closed-form world, and listings that do not fit."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dlama.datasets.layouts import open_dataset
from dlama.errors import CameraError, FileError
from posed_folders import LENS, check_frames, opencv_K, text_matrix, truth, write_codes16, write_picture


def written(root: Path, units: float = 6553.5) -> Path:
    """A scene in a folder, its camera next to that."""
    for number, frame in enumerate(truth()):
        write_picture(root / f"room0/results/frame{number:06d}.png", frame.color)
        write_codes16(root / f"room0/results/depth{number:06d}.png", frame.depth, units)
    poses = (text_matrix(frame.camera.world_from_cam, 8).replace("\n", " ") for frame in truth())
    (root / "room0/traj.txt").write_text("\n".join(poses) + "\n")
    (fx, _, cx), (_, fy, cy), _ = opencv_K(LENS).tolist()
    camera = {"w": LENS.width, "h": LENS.height, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "scale": units}
    (root / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return root


def test_frames_of_a_closed_form_world(tmp_path: Path) -> None:
    """Oracle: the world; the first pixel's centre is at 0.0, and the unit is the listing's."""
    dataset = open_dataset(written(tmp_path, 2000.0))
    assert dataset.layout == "replica" and dataset.frames[0].scene == "room0"
    check_frames(dataset)


def test_what_does_not_fit_is_named(tmp_path: Path) -> None:
    root = written(tmp_path)
    (root / "cam_params.json").unlink()
    with pytest.raises(CameraError, match=r"no cam_params\.json; give camera=FILE\.json"):
        open_dataset(root)
    check_frames(open_dataset(root, camera=LENS))
    (root / "room0/results/depth000001.png").unlink()
    with pytest.raises(FileError, match=r"holds 4 pictures frame\* and 3 depth\*, traj\.txt 4 poses"):
        open_dataset(root, camera=LENS)
