"""ARKitScenes recordings in (lowres_depth/, lowres_wide/ or vga_wide/, *_intrinsics/, lowres_wide.traj); posed frames, cases out.

Files are called VIDEO_SECONDS. lowres_wide.traj: seconds, axis times angle (radians) and translation (m), world to camera, OpenCV
axes; the pose nearest in time, at most 5 ms away, belongs to a depth picture. .pincam: width height fx fy cx cy. Depth in
millimetres, confidence 0 to 2. Format: github.com/apple/ARKitScenes, DATA.md and threedod/.../tenFpsDataLoader.py.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from dlama.datasets.posed.lenses import Lens
from dlama.datasets.posed.posed_frames import Listed, files_of_capture
from dlama.datasets.text_tables import files_by_stem, holds, nearest_in_time, pose_at, read_rows
from dlama.errors import FileError
from dlama.geometry.camera import Float64Array
from dlama.geometry.motion.poses import invert_pose, make_pose

DEPTH, POSES = "lowres_depth", "lowres_wide.traj"
looks_like = holds(DEPTH, POSES)
PICTURES = ("vga_wide", "lowres_wide")
"""The larger first."""
NEAREST_S = 0.005
"""Seconds by which a pose or a camera may differ from a picture (as in tenFpsDataLoader.py)."""


def list_frames(folder: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    pictures = next((folder / name for name in PICTURES if (folder / name).is_dir()), None)
    if pictures is None:
        raise FileError(f"{folder}: has neither {' nor '.join(PICTURES)} with the colour pictures")
    times, poses = _poses(folder / POSES)
    colors, levels = (files_by_stem(place, (".png",)) for place in (pictures, folder / "confidence"))
    depths = files_by_stem(folder / DEPTH, (".png",))
    lenses = files_by_stem(folder / f"{pictures.name}_intrinsics", (".pincam",))
    lens_names = sorted(lenses, key=_seconds)
    lens_times = np.array([_seconds(name) for name in lens_names])
    for name, depth in depths.items():
        pose, lens = (nearest_in_time(each, _seconds(name), NEAREST_S) for each in (times, lens_times))
        if name not in colors:
            yield name, "without a picture"
        elif pose is None:
            yield name, "without a pose"
        elif lens is None:
            yield name, "without a camera"
        else:
            own = _lens(lenses[lens_names[lens]])
            yield name, files_of_capture(colors[name], depth, own, poses[pose], levels.get(name))


def _seconds(name: str) -> float:
    """1234.567 of 41069021_1234.567."""
    try:
        return float(name.rpartition("_")[2])
    except ValueError as error:
        raise FileError(f"{name}: VIDEO_SECONDS is expected as the name of a file") from error


def _poses(path: Path) -> tuple[Float64Array, list[Float64Array]]:
    found = {}
    for row in read_rows(path):
        time, *values = row.numbers("seconds, axis times angle, translation", 7)
        cam_from_world = make_pose(cv2.Rodrigues(np.array(values[:3]))[0], values[3:])
        found[time] = pose_at(row.at(1), invert_pose(cam_from_world))
    times = sorted(found)
    return np.array(times), [found[time] for time in times]


def _lens(path: Path) -> Lens:
    rows = read_rows(path)
    if len(rows) != 1:
        raise FileError(f"{path}: holds {len(rows)} lines; one with width height fx fy cx cy is expected")
    width, height, fx, fy, cx, cy = rows[0].numbers("width height fx fy cx cy", 6)
    return Lens(str(path), (fx, fy, cx, cy), 0.5, (round(height), round(width)))
