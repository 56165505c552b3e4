"""Frames with depth and semantics in; folders in EasySynth's layout out, whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dlama.datasets.easysynth.frames import COLOR, DEPTH, MILLIMETRES, POSES, RIG, SEMANTIC
from dlama.datasets.easysynth.text_files import UNREAL_HEADER, unreal_pose
from dlama.errors import OutputError
from dlama.files.rasters.depth import write_depth_png
from dlama.files.rasters.exr_files import write_exr
from dlama.files.rasters.pictures import write_color
from dlama.files.semantic_classes import CLASSES_FILE, RGB
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.rgbd import RGBD, UInt8Array
from dlama.writing.atomic_write import new_directory, write_file

DEEPEST_MM = 65534.5
"""Beyond it a 16-bit picture of millimetres can only say far."""
MONO, LEFT, RIGHT = "CameraComponent", "c0", "c1"


class SequenceFrame(NamedTuple):
    """One frame of a sequence, as the writer takes it."""

    rgbd: RGBD
    """Colour, depth (metres, +inf = far, 0 = missing) and the posed camera (OpenCV axes, metres)."""
    semantic: UInt8Array
    """H x W, uint8: which class a pixel shows, as a number in the order of `classes` (0 = the first)."""


def write_scene(
    root: Path,
    scene: str,
    sequences: Mapping[str, Iterable[SequenceFrame] | Mapping[str, Iterable[SequenceFrame]]],
    *,
    depth_range: float,
    classes: Mapping[str, RGB],
    texts: Mapping[str, str] | None = None,
) -> None:
    """Write the sequences of a scene to `root/scene/<key>`, pictures called `<scene>_<key>.<NNNN>`; all of them or none.

    As EasySynth 1.2 writes it: poses in CameraPoses.csv (the rig's and the camera's), CameraRig.json, SemanticClasses.csv,
    ColorImage, SemanticImage, DepthImage (half-float EXR, R = G = B = depth / `depth_range` clipped to 0..1, in metres;
    1 = at or beyond it) and, beyond EasySynth, DepthMM (16-bit mm; beyond 65.534 m is far). Frames are gone through once, and
    all of a sequence have one lens; those of a rig are given by its cameras' names, in step, each pair rectified. `classes` are
    colours by name; `texts`: further files of the scene, name -> content. Raises OutputError.
    """
    target, colors = root / scene, np.array(list(classes.values()), np.uint8)
    if target.is_dir() and any(target.iterdir()):
        raise OutputError(
            f"{target}: is not empty; frames of two writings must not mix, remove it or give another place"
        )
    with new_directory(target) as draft:
        for key, frames in sequences.items():
            sides = frames if isinstance(frames, Mapping) else {MONO: frames}
            cameras = {
                camera: _write_pictures(draft / key / camera, f"{scene}_{key}", side, depth_range, colors)
                for camera, side in sides.items()
            }
            _write_rig(draft / key, cameras)
            lines = [f"{name},{red},{green},{blue}" for name, (red, green, blue) in classes.items()]
            write_file(draft / key / CLASSES_FILE, "\n".join(lines) + "\n")
        for name, text in (texts or {}).items():
            write_file(draft / name, text)


def _write_pictures(
    place: Path, name: str, frames: Iterable[SequenceFrame], depth_range: float, colors: UInt8Array
) -> list[Camera]:
    """One camera's pictures; returns its cameras, frame by frame. colors: N x 3, of the classes."""
    for kind in (COLOR, DEPTH, SEMANTIC, MILLIMETRES):
        (place / kind).mkdir(parents=True)
    cameras: list[Camera] = []
    for number, frame in enumerate(frames):
        stem, depth = f"{name}.{number:04d}", frame.rgbd.depth
        write_color(place / COLOR / f"{stem}.png", frame.rgbd.color)
        write_color(place / SEMANTIC / f"{stem}.png", colors[frame.semantic])
        limited = np.where(depth * 1000 > DEEPEST_MM, np.float32(np.inf), depth)
        write_depth_png(place / MILLIMETRES / f"{stem}.png", limited)
        grey = np.minimum(depth / np.float32(depth_range), 1).astype(np.float16)  # as Unreal writes it
        write_exr(place / DEPTH / f"{stem}.exr", {"R": grey, "G": grey, "B": grey, "A": np.ones_like(grey)})
        cameras.append(frame.rgbd.camera)
    return cameras


def _write_rig(folder: Path, cameras: Mapping[str, list[Camera]]) -> None:
    """The text files of a sequence; the first camera is the rig's pose."""
    rig = next(iter(cameras.values()))
    _write_poses(folder / POSES, rig)
    for name, each in cameras.items():
        _write_poses(folder / name / POSES, each)
    rig_from_world = rig[0].cam_from_world
    places = {name: _rig_camera(each[0], rig_from_world @ each[0].world_from_cam) for name, each in cameras.items()}
    write_file(folder / RIG, json.dumps({"cameras": places}, indent="\t"))


def _rig_camera(camera: Camera, rig_from_cam: Float64Array) -> dict[str, list[float]]:
    translation, quaternion = unreal_pose(rig_from_cam)
    return {
        "intrinsics": [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 0],  # EasySynth's last is 0, not 1
        "rotation": _round(quaternion),
        "translation": _round(translation),
        "sensor_size": [camera.width, camera.height],
    }


def _write_poses(path: Path, cameras: list[Camera]) -> None:
    lines = [",".join(UNREAL_HEADER)]
    for number, camera in enumerate(cameras):
        translation, quaternion = unreal_pose(camera.world_from_cam)
        values = [*_round(translation), *_round(quaternion), (number + 1) / 30]  # t begins at one frame time
        lines.append(f"{number}," + ",".join(f"{value:.9f}" for value in values))  # EasySynth: 6 digits
    write_file(path, "\n".join(lines) + "\n")


def _round(values: Float64Array) -> list[float]:
    """To nine digits, and no -0."""
    return [round(float(value), 9) + 0.0 for value in values]
