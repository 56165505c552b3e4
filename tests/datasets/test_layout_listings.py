"""TUM and Redwood / Open3D folders, whose listings have a line for each frame: a closed-form world, and bad lines by column."""

from __future__ import annotations

import json
import os
import pickle
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dlama.datasets.layouts import open_dataset
from dlama.datasets.posed.trajectory_log import read_log
from dlama.errors import CameraError, FileError, InputError
from posed_folders import (
    LENS,
    TUM_TIMES,
    cameras,
    check_frames,
    opencv_K,
    text_matrix,
    truth,
    write_codes16,
    write_picture,
    write_tum,
)

OPEN3D_LOG = """0 0 1
1.00000000 -0.00000000 -0.00000000 -0.00000000
-0.00000000 1.00000000 0.00000000 2.00000000
-0.00000000 -0.00000000 1.00000000 3.00000000
-0.00000000 0.00000000 -0.00000000 1.00000000
1 1 2
0.93969262 -0.00000000 0.34202014 2.00000000
-0.00000000 1.00000000 -0.00000000 2.00000000
-0.34202014 -0.00000000 0.93969262 3.00000000
-0.00000000 -0.00000000 -0.00000000 1.00000000
"""
"""What open3d 0.19 wrote for two cameras at (0, 2, 3) and (2, 2, 3), the second turned by 20 degrees about y."""


def write_redwood(root: Path, colors: str = "image", log: str = "trajectory.log") -> Path:
    text = ""
    for number, frame in enumerate(truth()):
        write_picture(root / f"{colors}/{number + 8}.png", frame.color)  # 8, 9, 10, 11: 10 after 9
        write_codes16(root / f"depth/{number + 8}.png", frame.depth)
        text += f"{number} {number} {number + 1}\n" + text_matrix(frame.camera.world_from_cam, 8)
    (root / log).parent.mkdir(exist_ok=True)
    (root / log).write_text(text)
    intrinsic = {"width": LENS.width, "height": LENS.height, "intrinsic_matrix": opencv_K(LENS).T.ravel().tolist()}
    (root / "camera_intrinsic.json").write_text(json.dumps(intrinsic))
    return root


def test_frames_of_a_closed_form_world(tmp_path: Path) -> None:
    """Oracle: the world. TUM's depth has 5000 units a metre, 65535 among them is nothing a Kinect says; of Open3D a pose's first
    line says which frame it is of, not its place in the file."""
    dataset = open_dataset(write_tum(tmp_path / "fr1_desk"))
    assert (dataset.name, dataset.layout) == ("fr1_desk", "tum")
    check_frames(dataset, half_unit_m=0.000101)
    case = dataset.cases[0]
    assert case.key == "vpi__fr1_desk__fr1_desk__1305031102.175304_to_1305031102.275304"
    assert np.array_equal(pickle.loads(pickle.dumps(case)).load().target.depth, case.load().target.depth)
    root = write_redwood(tmp_path / "redwood", "rgb", "scene/trajectory.log")
    lines = (root / "scene/trajectory.log").read_text().splitlines(keepends=True)
    (root / "scene/trajectory.log").write_text("".join([*lines[10:], *lines[:10]]))
    dataset = open_dataset(root)
    assert dataset.layout == "redwood"
    check_frames(dataset)


def test_what_open3d_wrote(tmp_path: Path) -> None:
    """Oracle: a file written by open3d 0.19 of known cameras."""
    (tmp_path / "t.log").write_text(OPEN3D_LOG)
    poses = read_log(tmp_path / "t.log", 2)
    a = np.radians(20)
    assert np.allclose(poses[0][:3, 3], [0, 2, 3]) and np.allclose(poses[1][:3, 3], [2, 2, 3])
    assert np.allclose(poses[1][:3, :3], [[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]], atol=1e-7)


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
    dataset = open_dataset(root)
    assert "1 of 4 frames are left out (1 without a pose within 0.02 s)" in caplog.text
    for frame, camera in zip(dataset.frames, cameras()):
        assert np.abs(frame.load().camera.world_from_cam - camera.world_from_cam).max() < 1e-6


def test_intrinsics_come_from_the_option_or_the_folder_or_not_at_all(tmp_path: Path) -> None:
    """A camera file without a size, as a text of fx fy cx cy (ETH3D), has that of the pictures."""
    root = write_tum(tmp_path / "data/seq")
    (root / "camera.json").rename(tmp_path / "mine.json")
    with pytest.raises(CameraError, match=r"camera\.json or calibration\.txt, and TUM's .*517\.3.*camera=FILE"):
        open_dataset(root)
    (tmp_path / "mine.txt").write_text(f"{LENS.fx} {LENS.fy} {LENS.cx - 0.5} {LENS.cy - 0.5}\n")
    for camera in (tmp_path / "mine.json", str(tmp_path / "mine.txt"), LENS):
        assert np.allclose(open_dataset(root, camera=camera).frames[0].load().camera.K, LENS.K)
    (tmp_path / "mine.json").rename(tmp_path / "data/camera.json")
    assert open_dataset(tmp_path / "data").frames[0].scene == "seq"


FIRST = f"{TUM_TIMES[0]:.6f}"


@pytest.mark.parametrize(
    ("write", "name", "line", "text", "message"),
    [
        (write_tum, "groundtruth.txt", 6, "1305031102.2 0 0 x 0 0 0 1", r"truth\.txt:6:18: 'x' stands where a finite"),
        (write_tum, "groundtruth.txt", 6, "1305031102.2 0 0 nan 0 0 0 1", r"truth\.txt:6:18: 'nan' stands where"),
        (write_tum, "groundtruth.txt", 6, "1305031102.2 0 0 0 0 0 1", r":6:25: the line has 7 values; 8 are expected"),
        (write_tum, "groundtruth.txt", 6, f"{FIRST} 0 0 0 0 0 0 2", r"truth\.txt:6:25: the quaternion has length 2; "),
        (write_tum, "rgb.txt", 6, "1305031102.2", r"rgb\.txt:6:13: the line has 1 values; 2 are expected \(time and"),
        (write_tum, "depth.txt", 6, "1305031103.0 a.png b", r"depth\.txt:6:20: the line has 3 values; 2 are expected"),
        (write_tum, "rgb.txt", 6, f"{FIRST} rgb/a.png", r"rgb\.txt:6:1: the time 1305031102\.175304 stands in line 2"),
        (write_redwood, "trajectory.log", 6, "7 1 2", r"log:6:1: the frame's place is 7; 0 to 3 is expected"),
        (write_redwood, "trajectory.log", 6, "0.5 1 2", r"trajectory\.log:6:1: the frame's place is 0\.5"),
        (write_redwood, "trajectory.log", 6, "0 0 1", r"trajectory\.log:6:1: frame 0 comes a second time"),
        (write_redwood, "trajectory.log", 7, "2 0 0 0", r"trajectory\.log:7:1: .*not a rigid motion"),
        (write_redwood, "trajectory.log", 7, "", r"log: holds 19 lines; 5 for each pose are expected"),
        (write_redwood, "camera_intrinsic.json", 1, '{"intrinsic_matrix": [1, 2]}', r"is \[1, 2\]; 9 finite"),
    ],
)
def test_bad_lines_are_named_with_line_and_column(
    tmp_path: Path, write: Callable[[Path], Path], name: str, line: int, text: str, message: str
) -> None:
    """Oracle: the column is where the bad value begins, counted from 1 as editors do."""
    file = write(tmp_path) / name
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[: line - 1], text, *lines[line:]]) + "\n")
    with pytest.raises(InputError, match=message):
        open_dataset(tmp_path)


def test_missing_parts(tmp_path: Path) -> None:
    root = write_redwood(tmp_path / "redwood")
    (root / "camera_intrinsic.json").unlink()
    with pytest.raises(CameraError, match=r"has no camera_intrinsic\.json or .*PrimeSense is 525 525 319\.5 239\.5"):
        open_dataset(root)
    (root / "depth/9.png").unlink()
    with pytest.raises(FileError, match=r"image/ holds 4 pictures and depth/ 3; as many are expected"):
        open_dataset(root, camera=LENS)
    (root / "image").rename(root / "pictures")
    with pytest.raises(FileError, match=r"has no folder image, rgb, color with the colour pictures"):
        open_dataset(root, camera=LENS)
    root = write_tum(tmp_path / "tum")
    (root / "depth.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match=r"depth\.txt: is no text \(byte 0 is not UTF-8\)"):
        open_dataset(root)
    (root / "depth.txt").unlink()
    words = r"holds no such data set.*looked for rgb\.txt, depth\.txt and groundtruth\.txt"
    with pytest.raises(FileError, match=words):
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
