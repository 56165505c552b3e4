"""7-Scenes and tsdf-fusion folders: closed-form frames; and real ones, whose depth is moved into the colour camera."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from dlama.datasets.layouts import open_dataset
from dlama.datasets.posed.numbered_frames import COLOR_FROM_DEPTH, COLOR_LENS, DEPTH_LENS
from dlama.datasets.posed.registered_depth import register_depth, warp_depth
from dlama.errors import CameraError, FileError, ShapeError
from dlama.files.cameras import write_camera
from dlama.geometry.camera import Camera
from posed_folders import LENS, check_frames, text_K, text_matrix, write_numbered


def written(root: Path) -> Path:
    return write_numbered(root, step=3, digits=7)


def test_seven_scenes_with_a_camera(tmp_path: Path) -> None:
    """Oracle: the world; 65535 is missing, as the set means it."""
    root = written(tmp_path / "chess/seq-01")
    write_camera(tmp_path / "camera.json", LENS)
    dataset = open_dataset(tmp_path, camera=tmp_path / "camera.json")
    assert dataset.layout == "7-scenes" and dataset.cases[0].scene == "chess_seq-01"
    check_frames(dataset)
    assert open_dataset(root, camera=LENS).frames[1].load().camera.same_view_as(dataset.frames[1].load().camera)


def test_seven_scenes_of_another_size_want_a_camera(tmp_path: Path) -> None:
    with pytest.raises(
        ShapeError, match=r"is 96x72, and 7-Scenes' measured colour camera \(camera=.*\) is for 640x480"
    ):
        open_dataset(written(tmp_path))


def test_real_depth_is_moved_into_the_colour_camera(tmp_path: Path, data_dir: Path) -> None:
    """Oracle: kitchen_vpi's registered depth and colour pose, made from the same raw files by others' code."""
    kitchen = data_dir / "data/kitchen_vpi"
    listing = json.loads((kitchen / "pairs.json").read_text())
    pair = listing["pairs"][0]
    for name in (pair["a"], pair["b"]):
        shutil.copy(kitchen / f"{name}.color.jpg", tmp_path)
        shutil.copy(kitchen / f"{name}.depth_raw.png", tmp_path / f"{name}.depth.png")
        pose = np.array(listing["frames"][name]["world_from_depth_cam"])
        (tmp_path / f"{name}.pose.txt").write_text(text_matrix(pose))
    ours, theirs = open_dataset(tmp_path), open_dataset(kitchen)
    for frame in ours.frames:
        mine, other = frame.load(), next(each for each in theirs.frames if each.name == frame.name).load()
        assert np.abs(mine.depth - other.depth).max() <= 0.001
        assert np.array_equal(mine.missing, other.missing)
        assert np.allclose(mine.camera.K, other.camera.K)
        # the sets' poses are rounded: moving the camera before or after making R a rotation differs by 4e-4 of 25 mm
        assert np.abs(mine.camera.world_from_cam - other.camera.world_from_cam).max() < 2e-5


def test_the_colour_camera_is_to_the_right_of_the_depth_camera() -> None:
    """Closed form: a point 2 m straight ahead of the depth camera (585 px, 320, 240) is 25 mm left of and 4 mm below the colour
    camera (526 px, 320, 237): at 320.5 - 6.6 and 237.5 + 1.1 px."""
    metres = np.zeros((480, 640), np.float32)
    metres[240, 320] = 2
    moved = register_depth(lambda: metres, DEPTH_LENS, COLOR_LENS, COLOR_FROM_DEPTH)
    assert np.argwhere(moved).tolist() == [[238, 313]] and moved[238, 313] == 2


def test_of_two_readings_in_one_pixel_the_nearest_stays() -> None:
    """Oracle: by hand. A camera with half the focal length sees four pixels in one."""
    source, target = Camera(4, 2, 4, 4, 2, 1), Camera(4, 2, 2, 2, 2, 1)
    depth = np.array([[5, 4, 2, 0], [3, 0, 7, 9]], np.float32)
    # columns 0, 1 -> 1.25, 1.75; 2, 3 -> 2.25, 2.75; rows 0, 1 -> 0.75, 1.25
    assert warp_depth(depth, source, target).tolist() == [[0, 4, 2, 0], [0, 3, 7, 0]]


def test_tsdf_fusion(tmp_path: Path) -> None:
    """Oracle: the world; K's first pixel has its centre at 0.0. The intrinsics lie beside or above the frames."""
    root = written(tmp_path / "rgbd-frames")
    (root / "camera-intrinsics.txt").write_text(text_K(LENS))
    dataset = open_dataset(root)
    assert dataset.layout == "tsdf-fusion"
    check_frames(dataset)
    (root / "camera-intrinsics.txt").rename(tmp_path / "camera-intrinsics.txt")
    for path in (tmp_path, root):
        assert open_dataset(path).frames[1].load().camera.same_view_as(dataset.frames[1].load().camera)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 0 0 0\n0 1 0 0\n0 0 1 0\n", r"pose\.txt: holds 3 lines of numbers; a 4x4 matrix is expected"),
        ("1 0 0 0\n0 1 0 0\n0 0 1.1 0\n0 0 0 1\n", r"pose\.txt:1:1: .*off by 0\.21 from orthonormal"),
        ("1 0 0 0\n0 -1 0 0\n0 0 1 0\n0 0 0 1\n", r"pose\.txt:1:1: .*a mirroring"),
        ("", r"pose\.txt: is empty"),
    ],
)
def test_bad_poses(tmp_path: Path, text: str, message: str) -> None:
    root = written(tmp_path)
    (root / "frame-000003.pose.txt").write_text(text)
    with pytest.raises((FileError, CameraError), match=r"frame-000003\." + message):
        open_dataset(root, camera=LENS)


def test_a_frame_without_colour_and_bad_intrinsics(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """What is refused, and what is left out and counted (oracle: the file that is deleted)."""
    root = written(tmp_path)
    (root / "camera-intrinsics.txt").write_text("90 1 40\n0 90 30\n0 0 1\n")
    with pytest.raises(CameraError, match=r"camera-intrinsics\.txt: K is .*no skew"):
        open_dataset(root)
    (root / "camera-intrinsics.txt").write_text(text_K(LENS))
    (root / "frame-000003.color.png").unlink()
    for camera in (None, LENS):
        names = [frame.name for frame in open_dataset(root, camera=camera).frames]
        assert names == ["frame-000000", "frame-000006", "frame-000009"]
    assert caplog.text.count("1 of 4 frames are left out (1 without a picture)") == 2
