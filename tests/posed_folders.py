"""A closed-form world and cameras that turn in it, as files: what the tests of posed layouts write and hold readers against."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from PIL import Image

from dlama.completion.verbs import view
from dlama.datasets.frames import Dataset, ViewTruth
from dlama.datasets.posed.nerfstudio import write_transforms, write_view
from dlama.datasets.posed.posed_frames import PosedFrame
from dlama.files.cameras import write_camera
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from whole_picture import check_same
from worlds import Plane, Sphere, World, moved

WORLD = World((Plane((0, 0, 3.2), (0.25, -0.1, -1)), Sphere((0.4, 0.2, 2.2), 0.45)))
LENS = Camera(96, 72, 90.5, 92.25, 46.25, 37.75)
"""First pixel's centre at 0.5, as the package counts."""
TURNS = (0.0, 10.0, 21.0, 29.0)
"""Degrees of the four frames about an axis that is none of the camera's."""
AXIS = np.array([0.3, 0.9, -0.2]) / np.linalg.norm([0.3, 0.9, -0.2])


@functools.cache
def cameras() -> tuple[Camera, ...]:
    """Four cameras that turn and move."""
    return tuple(
        moved(LENS, turn=tuple(turn * AXIS), shift=(-0.02 * turn, 0.004 * turn, 0.01 * turn))  # type: ignore[arg-type]
        for turn in TURNS
    )


@functools.cache
def truth() -> tuple[RGBD, ...]:
    """What they see."""
    return tuple(WORLD.rgbd(camera) for camera in cameras())


def write_codes16(path: Path, metres: np.ndarray, units_per_metre: float = 1000.0) -> None:
    """16-bit PNG; the first pixel gets 0 (missing) and the second 65535."""
    codes = np.rint(metres.astype(np.float64) * units_per_metre).astype(np.uint16)
    codes[0, :2] = 0, 65535
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(codes).save(path)


def write_picture(path: Path, color: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(color).save(path)


def text_matrix(matrix: np.ndarray, digits: int = 9) -> str:
    """As sensors' tools print it."""
    return "".join(" ".join(f"{value: .{digits}e}" for value in row) + "\n" for row in matrix)


def text_K(camera: Camera, size: int = 3) -> str:
    """K with the first pixel's centre at 0.0, as text, in the corner of an identity."""
    K = np.eye(size)
    K[:3, :3] = opencv_K(camera)
    return text_matrix(K)


def opencv_K(camera: Camera) -> np.ndarray:
    """K with the first pixel's centre at 0.0."""
    return camera.K - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]


def write_numbered(root: Path, step: int = 1, digits: int = 9) -> Path:
    """The four frames as 7-Scenes and tsdf-fusion number them, each `step` after the one before; poses in so many digits."""
    for number, frame in enumerate(truth()):
        name = f"frame-{step * number:06d}"
        write_picture(root / f"{name}.color.png", frame.color)
        write_codes16(root / f"{name}.depth.png", frame.depth)
        (root / f"{name}.pose.txt").write_text(text_matrix(frame.camera.world_from_cam, digits))
    return root


def write_nerfstudio(folder: Path, frames: Mapping[str, RGBD], cameras: Mapping[str, Camera]) -> Path:
    """Frames in nerfstudio's layout, as a sequence writes them, with cameras that may be others than theirs."""
    for kind in ("images", "depth", "hole", "origin", "source"):
        (folder / kind).mkdir(parents=True)
    for name, frame in frames.items():
        write_view(folder, name, View.from_rgbd(frame))
    write_transforms(folder, cameras, [], {})
    return folder


TUM_TIMES = [1305031102.175304 + 0.1 * number for number in range(len(TURNS))]


def quaternion(turn_deg: float) -> str:
    """qx qy qz qw of a rotation about AXIS, by its definition: axis sin(a/2), cos(a/2)."""
    half = math.radians(turn_deg) / 2
    return " ".join(f"{value:.9f}" for value in (*(math.sin(half) * AXIS), math.cos(half)))


def write_tum(root: Path, depth_late_s: float = 0.0199, pose_early_s: float = -0.0199) -> Path:
    """A sequence of four frames, poses between the frames' as a 100 Hz tracker gives them, and a camera.json."""
    root.mkdir(parents=True, exist_ok=True)
    rgb, depth, poses = "# color images\n", "# depth maps\n", "# timestamp tx ty tz qx qy qz qw\n"
    for time, turn, frame in zip(TUM_TIMES, TURNS, truth()):
        write_picture(root / f"rgb/{time:.6f}.png", frame.color)
        write_codes16(root / f"depth/{time + depth_late_s:.6f}.png", frame.depth, 5000)
        rgb += f"{time:.6f} rgb/{time:.6f}.png\n"
        depth += f"{time + depth_late_s:.6f} depth/{time + depth_late_s:.6f}.png\n"
        x, y, z = frame.camera.world_from_cam[:3, 3]
        poses += f"{time + pose_early_s:.4f} {x:.9f} {y:.9f} {z:.9f} {quaternion(turn)}\n"
    (root / "rgb.txt").write_text(rgb)
    (root / "depth.txt").write_text(depth)
    (root / "groundtruth.txt").write_text(poses)
    write_camera(root / "camera.json", LENS)
    return root


def check_frames(dataset: Dataset, *, half_unit_m: float = 0.00051, far: bool = False, range_m: float = np.inf) -> None:
    """Frames hold the true cameras, colours and depths, lie on the world's surfaces and are what their own cameras see; cases go
    between them.

    Oracle: the world's closed form. A wrong axis, pose, pixel centre, unit or order of frames fails here.
    """
    assert len(dataset.frames) == len(TURNS)
    for frame, camera, true in zip(dataset.frames, cameras(), truth()):
        read = frame.load()
        assert isinstance(frame, PosedFrame)
        assert np.array_equal(frame.world_from_cam, read.camera.world_from_cam)
        depth, seen_from = frame.load_depth()
        assert np.array_equal(depth, read.depth) and seen_from.same_view_as(read.camera)
        assert np.abs(read.camera.world_from_cam - camera.world_from_cam).max() < 1e-6
        assert np.allclose(read.camera.K, camera.K, atol=1e-6)
        assert np.array_equal(read.color, true.color)
        known = true.depth <= range_m - half_unit_m
        assert (read.depth[true.depth > range_m + half_unit_m] == 0).all()
        known[0, :2] = False
        assert np.abs(read.depth - true.depth)[known].max() <= half_unit_m
        assert read.depth[0, :2].tolist() == [0, np.inf if far else 0]
        check_on_surfaces(read, 2 * half_unit_m)
    check_same(view(read, filler="telea"), read)
    assert [case.yaw for case in dataset.cases[:2]] == [10.0, 21.0]
    check_pair(dataset.cases[-1].load())


def check_on_surfaces(frame: RGBD, within_m: float) -> None:
    """Lifted points lie on the world."""
    camera = frame.camera
    row, column = np.nonzero(frame.valid)
    local = np.stack(
        [(column + 0.5 - camera.cx) / camera.fx, (row + 0.5 - camera.cy) / camera.fy, np.ones(len(row))], 1
    )
    points = (local * frame.depth[frame.valid][:, None]) @ camera.world_from_cam[:3, :3].T + camera.world_from_cam[
        :3, 3
    ]
    assert WORLD.distance(points).max() < within_m


def check_registered(read: RGBD, true: RGBD) -> None:
    """Depth from a camera next to it: of most pixels, and of nine in ten of these within 2 % of the true depth."""
    assert read.color.shape == true.color.shape and read.valid.mean() > 0.7
    error = np.abs(read.depth - true.depth)[read.valid]
    assert np.percentile(error, 90) < 0.02 * np.median(true.depth)


def check_pair(pair: object) -> None:
    """Source and target are different frames of the world, of cameras that turned by what stands in TURNS."""
    assert isinstance(pair, ViewTruth) and pair.exposure_varies
    assert np.abs(pair.source.camera.world_from_cam - pair.target.camera.world_from_cam).max() > 0.01
