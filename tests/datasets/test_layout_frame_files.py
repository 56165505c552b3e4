"""Folders with files for each frame (7-Scenes, tsdf-fusion, ScanNet, Replica): closed-form frames, real ones, and bad files."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dlama.datasets.layouts import open_dataset
from dlama.datasets.posed.lenses import register_depth, warp_depth
from dlama.datasets.posed.numbered_frames import COLOR_FROM_DEPTH, COLOR_LENS, DEPTH_LENS
from dlama.errors import CameraError, InputError, ShapeError
from dlama.files.cameras import write_camera
from dlama.geometry.camera import Camera
from posed_folders import LENS, check_frames, opencv_K, text_K, text_matrix, truth, write_codes16, write_numbered
from posed_folders import write_picture as save


def write_scannet(root: Path, times: int = 1) -> Path:
    """Four frames; colour `times` as big as depth, each pixel repeated, so that its area mean is the pixel."""
    for number, frame in enumerate(truth()):
        save(root / f"color/{10 * number}.png", frame.color.repeat(times, 0).repeat(times, 1))
        write_codes16(root / f"depth/{10 * number}.png", frame.depth)
        (root / "pose").mkdir(exist_ok=True)
        (root / f"pose/{10 * number}.txt").write_text(text_matrix(frame.camera.world_from_cam))
    (root / "intrinsic").mkdir()
    (root / "intrinsic/intrinsic_color.txt").write_text(text_K(LENS.resized(*(times * side for side in LENS.wh)), 4))
    return root


def write_replica(root: Path, units: float = 6553.5) -> Path:
    """A scene in a folder, its camera next to that."""
    for number, frame in enumerate(truth()):
        save(root / f"room0/results/frame{number:06d}.png", frame.color)
        write_codes16(root / f"room0/results/depth{number:06d}.png", frame.depth, units)
    poses = (text_matrix(frame.camera.world_from_cam, 8).replace("\n", " ") for frame in truth())
    (root / "room0/traj.txt").write_text("\n".join(poses) + "\n")
    (fx, _, cx), (_, fy, cy), _ = opencv_K(LENS).tolist()
    camera = {"w": LENS.width, "h": LENS.height, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "scale": units}
    (root / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return root


def write_seven(root: Path) -> Path:
    return write_numbered(root, step=3, digits=7)


def write_tsdf(root: Path) -> Path:
    write_seven(root / "rgbd-frames")
    (root / "rgbd-frames/camera-intrinsics.txt").write_text(text_K(LENS))
    return root


@pytest.mark.parametrize(
    ("write", "layout", "scene", "camera"),
    [
        (lambda root: write_seven(root / "chess/seq-01").parents[1], "7-scenes", "chess_seq-01", LENS),
        (write_tsdf, "tsdf-fusion", "rgbd-frames", None),
        (lambda root: write_scannet(root / "scene0000_00", 2), "scannet", "scene0000_00", None),
        (lambda root: write_replica(root, 2000.0), "replica", "room0", None),
    ],
)
def test_frames_of_a_closed_form_world(
    tmp_path: Path, write: Callable[[Path], Path], layout: str, scene: str, camera: Camera | None
) -> None:
    """Oracle: the world; K's first pixel has its centre at 0.0 and scales about the picture's corner, half a pixel from there;
    65535 is missing, as these sets mean it; the unit is the listing's."""
    dataset = open_dataset(write(tmp_path), camera=camera)
    assert dataset.layout == layout and dataset.cases[0].scene == scene
    check_frames(dataset)


def test_where_a_camera_lies(tmp_path: Path) -> None:
    """tsdf-fusion's intrinsics next to or above the frames; a camera's file as the camera itself; one in place of a lost file."""
    expected = open_dataset(write_tsdf(tmp_path)).frames[1].load().camera
    (tmp_path / "rgbd-frames/camera-intrinsics.txt").rename(tmp_path / "camera-intrinsics.txt")
    for path in (tmp_path, tmp_path / "rgbd-frames"):
        assert open_dataset(path).frames[1].load().camera.same_view_as(expected)
    write_camera(tmp_path / "camera.json", LENS)
    (tmp_path / "camera-intrinsics.txt").unlink()
    for camera in (LENS, tmp_path / "camera.json"):
        found = open_dataset(tmp_path, camera=camera)
        assert found.layout == "7-scenes" and found.frames[1].load().camera.same_lens_as(LENS)
    of_scannet = r"has no intrinsic/intrinsic_color\.txt or intrinsics_color\.txt, and .*"
    for root, lost, words in (
        (write_scannet(tmp_path / "a"), "intrinsic/intrinsic_color.txt", of_scannet),
        (write_replica(tmp_path / "b"), "cam_params.json", r"no cam_params\.json; "),
    ):
        (root / lost).unlink()
        with pytest.raises(CameraError, match=rf"{words}give camera=FILE\.json"):
            open_dataset(root)
        check_frames(open_dataset(root, camera=LENS))


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


SEVEN = "frame-000003.pose.txt"


@pytest.mark.parametrize(
    ("write", "file", "text", "message"),
    [
        (write_seven, SEVEN, text_matrix(np.eye(4)[:3]), r"3\.pose\.txt: holds 3 lines of numbers; a 4x4 matrix is"),
        (write_seven, SEVEN, text_matrix(np.diag([1, 1, 1.1, 1])), r"3\.pose\.txt:1:1: .*off by 0\.21 from orthon"),
        (write_seven, SEVEN, text_matrix(np.diag([1, -1, 1, 1])), r"3\.pose\.txt:1:1: .*a mirroring"),
        (write_seven, SEVEN, "", r"frame-000003\.pose\.txt: is empty"),
        (write_scannet, "pose/10.txt", "1 0 0 nan\n" + "0 1 0 0\n" * 3, r"10\.txt:1:7: 'nan' stands where a number"),
        (write_replica, "room0/traj.txt", "1 0 0 0", r"4 pictures frame\* and 4 depth\*, traj\.txt 1 poses; as many"),
    ],
)
def test_bad_poses(tmp_path: Path, write: Callable[[Path], Path], file: str, text: str, message: str) -> None:
    root = write(tmp_path)
    (root / file).write_text(text)
    with pytest.raises(InputError, match=message):
        open_dataset(root, camera=LENS)


def test_intrinsics_with_skew(tmp_path: Path) -> None:
    root = write_tsdf(tmp_path) / "rgbd-frames"
    (root / "camera-intrinsics.txt").write_text("90 1 40\n0 90 30\n0 0 1\n")
    with pytest.raises(CameraError, match=r"camera-intrinsics\.txt: K is .*no skew"):
        open_dataset(root)


def test_the_frames_of_scannet_s_benchmark(tmp_path: Path) -> None:
    """Oracle: the world; scannet_frames_25k has K next to the folders."""
    root = write_scannet(tmp_path / "scene0000_00", 2)
    (root / "intrinsic/intrinsic_color.txt").rename(root / "intrinsics_color.txt")
    assert open_dataset(tmp_path).frames[0].load().camera.same_lens_as(LENS)


def test_frames_that_lack_something_are_left_out_and_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Oracle: the files that are deleted or lost; a pose of -inf is one that was not found."""
    root = write_tsdf(tmp_path / "a") / "rgbd-frames"
    (root / "frame-000003.color.png").unlink()
    for camera in (None, LENS):
        names = [frame.name for frame in open_dataset(root, camera=camera).frames]
        assert names == ["frame-000000", "frame-000006", "frame-000009"]
    assert caplog.text.count("1 of 4 frames are left out (1 without a picture)") == 2
    root = write_scannet(tmp_path / "b")
    (root / "pose/10.txt").write_text("-inf -inf -inf -inf\n" * 4)
    (root / "color/20.png").unlink()
    assert [frame.name for frame in open_dataset(root).frames] == ["0", "30"]
    assert "2 of 4 frames are left out (1 without a pose: tracking was lost, 1 without a picture)" in caplog.text
    root = write_scannet(tmp_path / "c")
    (root / "pose/10.txt").unlink()
    assert [frame.name for frame in open_dataset(root).frames] == ["0", "20", "30"]
    assert "1 of 4 frames are left out (1 without a pose)" in caplog.text


def test_colour_bigger_than_depth_is_the_mean_of_its_area(tmp_path: Path) -> None:
    """Closed form: (0 + 100 + 200 + 40) / 4 = 85. Sizes that cannot belong together are named."""
    root, color = write_scannet(tmp_path, 2), np.zeros((144, 192, 3), np.uint8)
    color[:2, :2] = np.array([[0, 100], [200, 40]])[..., None]
    save(root / "color/0.png", color)
    dataset = open_dataset(root)
    assert dataset.frames[0].load().color[0, :2, 0].tolist() == [85, 0]
    for frame in dataset.frames:
        save(root / f"color/{frame.name}.png", color[:36, :48])
    with pytest.raises(ShapeError, match=r"color/0\.png: is 48x36 and .*depth/0\.png 96x72; colour of the same size"):
        open_dataset(root)
    with pytest.raises(ShapeError, match=r"is 96x72, and 7-Scenes' measured colour camera \(.*\) is for 640x480"):
        open_dataset(write_seven(tmp_path / "chess"), "7-scenes")
