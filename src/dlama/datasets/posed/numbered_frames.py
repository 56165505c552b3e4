"""Folders of frame-XXXXXX.color.png|jpg, .depth.png, .pose.txt in (7-Scenes, tsdf-fusion); posed frames and their cases out.

Depth in millimetres, 0 and 65535 missing; poses camera to world.
7-Scenes: a pose is the depth camera's. Colour and depth come from two cameras that the set does not align (its page gives
585, 585, 320, 240 for depth and nothing for colour): depth is moved into the colour camera, whose numbers were measured on
redkitchen (COLOR_LENS, COLOR_FROM_DEPTH). With `camera` the two are taken as one camera instead.
tsdf-fusion: one 3x3 K for colour and depth in camera-intrinsics.txt next to the frames or one folder above, first pixel's
centre at 0.0 (the fusion code rounds projections to whole pixels). Format: github.com/andyzeng/tsdf-fusion.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dlama.datasets.posed.posed_frames import (
    CameraOption,
    FrameFiles,
    Lens,
    PosedFrame,
    files_of,
    lens_for,
    load_depth,
    posed_frame,
)
from dlama.datasets.text_tables import files_in, read_pose
from dlama.errors import FileError, ShapeError
from dlama.files.cameras import make_camera
from dlama.geometry.camera import Camera
from dlama.geometry.poses import invert_pose
from dlama.geometry.projection import project, rays
from dlama.geometry.rgbd import RGBD, Float32Array

DEPTH_LENS = Lens("7-Scenes' published camera", (585.0, 585.0, 320.0, 240.0), 0.0, (480, 640))
COLOR_LENS = Lens("7-Scenes' measured colour camera", (526.0, 526.0, 320.0, 237.0), 0.0, (480, 640))
COLOR_FROM_DEPTH = np.array([[1, 0, 0, -0.025], [0, 1, 0, 0.004], [0, 0, 1, 0], [0, 0, 0, 1.0]])
"""Metres. Measured, not published: image edges against depth edges, and agreement of brightness across views."""
CAMERA_NAMES = ("camera.json",)
COLOR_SUFFIXES = (".png", ".jpg")
TSDF_INTRINSICS = "camera-intrinsics.txt"


def looks_like_seven_scenes(root: Path) -> bool:
    """True where numbered frames lie in a folder, and tsdf-fusion's intrinsics neither there nor above."""
    return has_numbered_frames(root) and not any((each / TSDF_INTRINSICS).is_file() for each in (root, root.parent))


def looks_like_tsdf_fusion(root: Path) -> bool:
    """True where numbered frames lie in a folder, and tsdf-fusion's intrinsics there or above."""
    return has_numbered_frames(root) and any((each / TSDF_INTRINSICS).is_file() for each in (root, root.parent))


def has_numbered_frames(root: Path) -> bool:
    """True if frame-*.color.*, its depth and its pose lie right in the folder."""
    first = next(root.glob("frame-*.pose.txt"), None)
    return first is not None and first.with_name(f"{frame_name(first)}.depth.png").is_file()


def seven_scenes_frames(scene: str, folder: Path, root: Path, camera: CameraOption) -> list[PosedFrame]:
    """The frames of one sequence of 7-Scenes. Raises FileError, CameraError."""
    if camera is None:
        return numbered_frames(scene, folder, DEPTH_LENS, _registered_frame)
    return numbered_frames(scene, folder, lens_for(folder, root, camera, CAMERA_NAMES, ""), posed_frame)


def tsdf_fusion_frames(scene: str, folder: Path, root: Path, camera: CameraOption) -> list[PosedFrame]:
    """The frames of one sequence, whose K lies in its folder or in the one above. Raises FileError, CameraError."""
    advice = f"the layout needs a {TSDF_INTRINSICS}"
    lens = lens_for(folder, folder.parent, camera, (TSDF_INTRINSICS,), advice)
    return numbered_frames(scene, folder, lens, posed_frame)


class NumberedLayout(NamedTuple):
    """What the other layouts have as functions of their files."""

    looks_like: Callable[[Path], bool]
    list_frames: Callable[[str, Path, Path, CameraOption], list[PosedFrame]]


SEVEN_SCENES = NumberedLayout(looks_like_seven_scenes, seven_scenes_frames)
TSDF_FUSION = NumberedLayout(looks_like_tsdf_fusion, tsdf_fusion_frames)


def frame_name(path: Path) -> str:
    """frame-000012 of frame-000012.pose.txt."""
    return path.name.split(".")[0]


def numbered_frames(
    scene: str, folder: Path, lens: Lens, make: Callable[[str, str, FrameFiles], PosedFrame]
) -> list[PosedFrame]:
    """The frames of one folder in the order of their numbers, each made of its files and its pose; raises FileError."""
    frames = []
    for pose in files_in(folder, (".txt",)):
        if pose.name.endswith(".pose.txt"):
            name = frame_name(pose)
            colors = [folder / f"{name}.color{suffix}" for suffix in COLOR_SUFFIXES]
            color = next((each for each in colors if each.is_file()), None)
            if color is None:
                raise FileError(f"{colors[0]}: no such file (nor {colors[1].name}), but {pose.name} is there")
            files = files_of(color, folder / f"{name}.depth.png", lens, read_pose(pose))
            frames.append(make(scene, name, files))
    return frames


def _registered_frame(scene: str, name: str, files: FrameFiles) -> PosedFrame:
    pose = files.world_from_cam @ invert_pose(COLOR_FROM_DEPTH)
    load, depth = partial(load_registered, files), partial(load_registered_depth, files)
    return PosedFrame(scene, name, load, world_from_cam=pose, load_depth=depth)


def load_registered(files: FrameFiles) -> RGBD:
    """Colour as it is, and the depth moved into the colour camera; raises FileError, DepthError, ShapeError."""
    depth, camera = load_registered_depth(files)
    color = files.color()
    if color.shape[:2] != camera.hw:
        raise ShapeError(
            f"{files.names[0]}: is {color.shape[1]}x{color.shape[0]}; 640x480 is expected, or a camera that says otherwise"
        )
    return RGBD(color, depth, camera)


def load_registered_depth(files: FrameFiles) -> tuple[Float32Array, Camera]:
    """The depth moved into the colour camera, and that camera at its pose."""
    depth, depth_camera = load_depth(files)
    pose = files.world_from_cam @ invert_pose(COLOR_FROM_DEPTH)
    color_camera = make_camera(COLOR_LENS.source, depth_camera.hw, COLOR_LENS.intrinsics, COLOR_LENS.pixel_center, pose)
    return warp_depth(depth, depth_camera, color_camera), color_camera


def warp_depth(depth: Float32Array, source: Camera, target: Camera) -> Float32Array:
    """Depth as seen from another camera close by: each reading goes to the pixel it falls into, the nearest wins.

    H x W of the target, 0 where nothing fell. Fit for a target with the shorter focal length, where no cracks open.
    """
    rows, columns = np.nonzero(depth)
    z = depth[rows, columns].astype(np.float64)
    local = rays(source)[rows, columns] * z[:, None]
    pose = source.world_from_cam
    pixels, seen_at = project(local @ pose[:3, :3].T + pose[:3, 3], target)
    inside = (pixels >= 0).all(1) & (pixels[:, 0] < target.width) & (pixels[:, 1] < target.height)
    flat = pixels[inside].astype(np.intp) @ (1, target.width)
    out = np.full(target.height * target.width, np.inf, np.float32)
    np.minimum.at(out, flat, seen_at[inside].astype(np.float32))
    out[np.isinf(out)] = 0
    return out.reshape(target.hw)
