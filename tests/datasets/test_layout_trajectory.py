"""Redwood / Open3D folders: a closed-form world, files as Open3D writes them, and bad lines by line and column."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dlama.datasets.layouts import open_dataset
from dlama.datasets.posed.lenses import read_lens
from dlama.datasets.posed.trajectory_log import read_log
from dlama.errors import CameraError, FileError
from posed_folders import LENS, check_frames, opencv_K, text_matrix, truth, write_codes16, write_picture

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
OPEN3D_INTRINSIC = """{
	"height" : 48,
	"intrinsic_matrix" : [60.0, 0.0, 0.0, 0.0, 61.0, 0.0, 30.699999999999999, 24.199999999999999, 1.0],
	"width" : 64
}"""


def written(root: Path, colors: str = "image", log: str = "trajectory.log") -> Path:
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
    """Oracle: the world; Open3D's K puts the first pixel's centre at 0.0, its matrix is listed by columns. A pose's first line
    says which frame it is of, not its place in the file."""
    root = written(tmp_path, "rgb", "scene/trajectory.log")
    lines = (root / "scene/trajectory.log").read_text().splitlines(keepends=True)
    (root / "scene/trajectory.log").write_text("".join([*lines[10:], *lines[:10]]))
    dataset = open_dataset(root)
    assert dataset.layout == "redwood"
    check_frames(dataset)


def test_what_open3d_wrote(tmp_path: Path) -> None:
    """Oracle: files written by open3d 0.19 of known cameras."""
    (tmp_path / "t.log").write_text(OPEN3D_LOG)
    poses = read_log(tmp_path / "t.log", 2)
    a = np.radians(20)
    assert np.allclose(poses[0][:3, 3], [0, 2, 3]) and np.allclose(poses[1][:3, 3], [2, 2, 3])
    assert np.allclose(poses[1][:3, :3], [[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]], atol=1e-7)
    (tmp_path / "i.json").write_text(OPEN3D_INTRINSIC)
    lens = read_lens(tmp_path / "i.json")
    camera = lens.camera(np.eye(4))
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == pytest.approx((60, 61, 31.2, 24.7)) and lens.hw == (48, 64)


@pytest.mark.parametrize(
    ("line", "text", "message"),
    [
        (6, "7 1 2\n", r"trajectory\.log:6:1: the frame's place is 7; 0 to 3 is expected"),
        (6, "0.5 1 2\n", r"trajectory\.log:6:1: the frame's place is 0\.5"),
        (6, "0 0 1\n", r"trajectory\.log:6:1: frame 0 comes a second time"),
        (7, "2 0 0 0\n", r"trajectory\.log:7:1: .*not a rigid motion"),
        (7, "", r"trajectory\.log: holds 19 lines; 5 for each pose are expected"),
    ],
)
def test_bad_lines_are_named(tmp_path: Path, line: int, text: str, message: str) -> None:
    root = written(tmp_path)
    lines = (root / "trajectory.log").read_text().splitlines(keepends=True)
    lines[line - 1] = text
    (root / "trajectory.log").write_text("".join(lines))
    with pytest.raises((FileError, CameraError), match=message):
        open_dataset(root)


def test_missing_parts(tmp_path: Path) -> None:
    root = written(tmp_path)
    intrinsic = root / "camera_intrinsic.json"
    intrinsic.write_text('{"width": 96, "height": 72, "intrinsic_matrix": [1, 2]}')
    with pytest.raises(CameraError, match=r"intrinsic_matrix is \[1, 2\]; 9 finite numbers are expected"):
        open_dataset(root)
    intrinsic.unlink()
    with pytest.raises(CameraError, match=r"has no camera_intrinsic\.json or .*PrimeSense is 525 525 319\.5 239\.5"):
        open_dataset(root)
    (root / "depth/9.png").unlink()
    with pytest.raises(FileError, match=r"image/ holds 4 pictures and depth/ 3; as many are expected"):
        open_dataset(root, camera=LENS)
    (root / "image").rename(root / "pictures")
    with pytest.raises(FileError, match=r"has no folder image, rgb, color with the colour pictures"):
        open_dataset(root, camera=LENS)
