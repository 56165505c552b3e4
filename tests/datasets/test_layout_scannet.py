"""ScanNet scenes written from a closed-form world: colour bigger than depth, lost poses, bad files."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from dlama.datasets.layouts import open_dataset
from dlama.errors import CameraError, FileError, ShapeError
from dlama.geometry.camera import Camera
from posed_folders import LENS, WORLD, cameras, check_frames, text_K, text_matrix, truth, write_codes16, write_picture


def written(root: Path, times: int = 1) -> Path:
    """Four frames; colour `times` as big as depth, each pixel repeated, so that its area mean is the pixel."""
    for number, frame in enumerate(truth()):
        write_picture(root / f"color/{10 * number}.png", frame.color.repeat(times, 0).repeat(times, 1))
        write_codes16(root / f"depth/{10 * number}.png", frame.depth)
        (root / "pose").mkdir(exist_ok=True)
        (root / f"pose/{10 * number}.txt").write_text(text_matrix(frame.camera.world_from_cam))
    big = Camera(*(times * size for size in LENS.wh), *(times * each for each in (LENS.fx, LENS.fy, LENS.cx, LENS.cy)))
    (root / "intrinsic").mkdir()
    (root / "intrinsic/intrinsic_color.txt").write_text(text_K(big, 4))
    return root


def test_colour_bigger_than_depth_shrinks_and_its_camera_with_it(tmp_path: Path) -> None:
    """Oracle: the world; K scales about the picture's corner, which is half a pixel from the file's origin. Colour is the mean of
    the area: (0 + 100 + 200 + 40) / 4 = 85."""
    root = written(tmp_path / "scene0000_00", 2)
    dataset = open_dataset(root)
    assert dataset.layout == "scannet" and [frame.name for frame in dataset.frames] == ["0", "10", "20", "30"]
    check_frames(dataset)
    color = np.zeros((144, 192, 3), np.uint8)
    color[:2, :2] = np.array([[0, 100], [200, 40]])[..., None]
    write_picture(root / "color/0.png", color)
    assert open_dataset(root).frames[0].load().color[0, :2, 0].tolist() == [85, 0]


def test_lost_poses_are_left_out_and_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    root = written(tmp_path)
    (root / "pose/10.txt").write_text("-inf -inf -inf -inf\n" * 4)
    (root / "color/20.png").unlink()
    with caplog.at_level(logging.WARNING, logger="dlama"):
        dataset = open_dataset(root)
    left_out = "2 of 4 frames are left out (1 without a pose: tracking was lost, 1 without a picture)"
    assert left_out in caplog.text and [frame.name for frame in dataset.frames] == ["0", "30"]


def test_the_colour_camera_may_be_given(tmp_path: Path) -> None:
    root = written(tmp_path)
    (root / "intrinsic/intrinsic_color.txt").unlink()
    with pytest.raises(CameraError, match=r"has no intrinsic/intrinsic_color\.txt, and .*give camera=FILE"):
        open_dataset(root)
    check_frames(open_dataset(root, camera=LENS))


def test_a_nan_pose_is_no_lost_pose(tmp_path: Path) -> None:
    root = written(tmp_path)
    (root / "pose/10.txt").write_text("1 0 0 nan\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    with pytest.raises(FileError, match=r"10\.txt:1:7: 'nan' stands where a number is expected"):
        open_dataset(root)


def test_sizes_that_do_not_belong_together(tmp_path: Path) -> None:
    root = written(tmp_path)
    for frame, camera in zip(open_dataset(root).frames, cameras()):
        small = WORLD.rgbd(Camera(48, 36, 45, 45, 24, 18, camera.world_from_cam))
        write_picture(root / f"color/{frame.name}.png", small.color)
    with pytest.raises(ShapeError, match=r"color/0\.png: is 48x36 and .*depth/0\.png 96x72; colour of the same size"):
        open_dataset(root)
