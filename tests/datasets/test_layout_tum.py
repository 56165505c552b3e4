"""TUM sequences written from a closed-form world: frames, time stamps, intrinsics, and bad lines by line and column."""

from __future__ import annotations

import logging
import os
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest

from dlama.datasets.layouts import open_dataset
from dlama.errors import CameraError, FileError
from posed_folders import LENS, TUM_TIMES, cameras, check_frames, write_tum


def test_frames_of_a_closed_form_world(tmp_path: Path) -> None:
    """Oracle: the world; depth has 5000 units a metre, 65535 among them is nothing a Kinect says."""
    dataset = open_dataset(write_tum(tmp_path / "fr1_desk"))
    assert (dataset.name, dataset.layout) == ("fr1_desk", "tum")
    check_frames(dataset, half_unit_m=0.000101)
    assert dataset.cases[0].key == "vpi__fr1_desk__fr1_desk__1305031102.175304_to_1305031102.275304"


def test_cases_travel_to_another_process(tmp_path: Path) -> None:
    """Oracle: a pickled case loads what the case loads."""
    case = open_dataset(write_tum(tmp_path)).cases[0]
    there, here = pickle.loads(pickle.dumps(case)).load(), case.load()
    assert np.array_equal(there.target.depth, here.target.depth)


def test_time_stamps_beyond_the_tolerance_belong_to_nothing(tmp_path: Path) -> None:
    """Oracle: 0.02 s, the stated tolerance; 0.0205 s is beyond it, to both sides."""
    with pytest.raises(FileError, match=r"4 without depth within 0\.02 s"):
        open_dataset(write_tum(tmp_path / "a", depth_late_s=0.0205, pose_early_s=0.0))
    with pytest.raises(FileError, match=r"4 without a pose within 0\.02 s"):
        open_dataset(write_tum(tmp_path / "b", depth_late_s=0.0, pose_early_s=-0.0205))


def test_the_nearest_of_several_is_taken_and_leftovers_are_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Oracle: the written poses; a decoy on the other side is farther, and lines may come in any order."""
    root = write_tum(tmp_path, pose_early_s=-0.0101)
    lines = (root / "groundtruth.txt").read_text().splitlines()
    decoy = f"{TUM_TIMES[1] + 0.0104:.4f} 9 9 9 0 0 0 1"
    (root / "groundtruth.txt").write_text("\n".join([decoy, *lines[:-1]]) + "\n")
    with caplog.at_level(logging.WARNING, logger="dlama"):
        dataset = open_dataset(root)
    assert "1 of 4 frames are left out (1 without a pose within 0.02 s)" in caplog.text
    for frame, camera in zip(dataset.frames, cameras()):
        assert np.abs(frame.load().camera.world_from_cam - camera.world_from_cam).max() < 1e-6


def test_intrinsics_come_from_the_option_or_the_folder_or_not_at_all(tmp_path: Path) -> None:
    root = write_tum(tmp_path / "data/seq")
    (root / "camera.json").rename(tmp_path / "mine.json")
    with pytest.raises(
        CameraError, match=r"no camera\.json or calibration\.txt, and TUM's intrinsics.*517\.3.*camera=FILE"
    ):
        open_dataset(root)
    for camera in (tmp_path / "mine.json", str(tmp_path / "mine.json"), LENS):
        assert np.allclose(open_dataset(root, camera=camera).frames[0].load().camera.K, LENS.K)
    rows = f"data: [{LENS.fx}, 0., {LENS.cx - 0.5}, 0., {LENS.fy}, {LENS.cy - 0.5}, 0., 0., 1.]"
    matrix, size = f"camera_matrix:\n  rows: 3\n  cols: 3\n  {rows}\n", "image_width: 96\nimage_height: 72\n"
    for text in (size + matrix, matrix):  # ROS puts the first pixel's centre at 0
        (tmp_path / "mine.yaml").write_text(text, "utf-8")
        assert np.allclose(open_dataset(root, camera=tmp_path / "mine.yaml").frames[0].load().camera.K, LENS.K)
    of_eth3d = root / "calibration.txt"  # BAD SLAM reads it so: fx fy cx cy, the first pixel's centre at 0
    of_eth3d.write_text(f"{LENS.fx} {LENS.fy} {LENS.cx - 0.5} {LENS.cy - 0.5}\n")
    assert np.allclose(open_dataset(root).frames[0].load().camera.K, LENS.K)
    of_eth3d.unlink()
    (tmp_path / "mine.json").rename(tmp_path / "data/camera.json")
    assert open_dataset(tmp_path / "data").frames[0].scene == "seq"


@pytest.mark.parametrize(
    ("name", "line", "message"),
    [
        ("groundtruth.txt", "1305031102.2 0 0 x 0 0 0 1", r"groundtruth\.txt:6:18: 'x' stands where a finite number"),
        ("groundtruth.txt", "1305031102.2 0 0 nan 0 0 0 1", r"groundtruth\.txt:6:18: 'nan' stands where"),
        ("groundtruth.txt", "1305031102.2 0 0 0 0 0 1", r"truth\.txt:6:25: the line has 7 values; 8 are expected"),
        ("groundtruth.txt", f"{TUM_TIMES[0]:.6f} 0 0 0 0 0 0 2", r"truth\.txt:6:25: the quaternion has length 2; "),
        ("rgb.txt", "1305031102.2", r"rgb\.txt:6:13: the line has 1 values; 2 are expected \(time and file name\)"),
        ("depth.txt", "1305031103.0 a.png b", r"depth\.txt:6:20: the line has 3 values; 2 are expected"),
        ("rgb.txt", f"{TUM_TIMES[0]:.6f} rgb/a.png", r"rgb\.txt:6:1: the time 1305031102\.175304 stands in line 2 too"),
    ],
)
def test_bad_lines_are_named_with_line_and_column(tmp_path: Path, name: str, line: str, message: str) -> None:
    """Oracle: the column is where the bad value begins, counted from 1 as editors do."""
    root = write_tum(tmp_path)
    with (root / name).open("a") as stream:
        stream.write(line + "\n")
    with pytest.raises(FileError, match=message):
        open_dataset(root)


def test_no_text_and_no_file(tmp_path: Path) -> None:
    root = write_tum(tmp_path)
    (root / "depth.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match=r"depth\.txt: is no text \(byte 0 is not UTF-8\)"):
        open_dataset(root)
    (root / "depth.txt").unlink()
    with pytest.raises(
        FileError, match=r"holds no such data set.*looked for rgb\.txt, depth\.txt and groundtruth\.txt"
    ):
        open_dataset(root, "tum")


def test_a_broken_picture_spoils_its_own_cases_only(tmp_path: Path) -> None:
    """Its cases are listed, and say when loaded which file is bad; all others load."""
    root = write_tum(tmp_path)
    bad = sorted((root / "depth").iterdir())[1]
    bad.write_bytes(bad.read_bytes()[:100])
    outcomes = []
    for case in open_dataset(root).cases:
        try:
            case.load()
            outcomes.append("fine")
        except FileError as error:
            assert bad.name in str(error)
            outcomes.append("bad")
    assert {"fine", "bad"} == set(outcomes)


@pytest.mark.skipif(os.name == "nt" or sys.platform == "darwin", reason="names are text there")
def test_names_that_are_no_text_are_refused(tmp_path: Path) -> None:
    """Of scenes and of the set itself: results and hashes are made of them (oracle: the bytes of the name in the message)."""
    for place in (tmp_path / os.fsdecode(b"set\xff"), tmp_path / "set" / os.fsdecode(b"set\xff")):
        write_tum(place)
        with pytest.raises(FileError, match=r"the name b'set.xff' in it is no UTF-8 text; rename it"):
            open_dataset(place if place.parent == tmp_path else place.parent)
