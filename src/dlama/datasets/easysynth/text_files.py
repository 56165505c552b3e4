"""CameraPoses.csv and CameraRig.json in; posed cameras (OpenCV axes, metres) out; bad values named by line and column.

Unreal's axes are left-handed, X forward, Y right, Z up, in centimetres; its quaternion turns camera axes into world axes.
With P the map of axes to OpenCV's (det P = -1: the handedness flips) R_cv = P R(q) P^T and t_cv = P t / 100.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dlama.datasets.posed.lenses import Lens
from dlama.datasets.text_tables import Row, read_rows, rotation_at
from dlama.errors import CameraError, FileError
from dlama.files.fields import FileFields, json_fields
from dlama.files.semantic_classes import unreal_text
from dlama.geometry.camera import Float64Array
from dlama.geometry.motion.poses import make_pose, quaternion_from_rotation

OPENCV_FROM_UNREAL = np.array([[0.0, 1, 0], [0, 0, -1], [1, 0, 0]])
"""x = Y, y = -Z, z = X."""
CENTIMETRES = 100.0
UNREAL_HEADER = ("id", "tx", "ty", "tz", "qx", "qy", "qz", "qw", "t")
"""EasySynth 1.2 and later, and its branch for Unreal 4.27: centimetres, Unreal axes, no intrinsics."""
METRIC_HEADER = ("id", "tx", "ty", "tz", "qw", "qx", "qy", "qz", "fx", "fy", "cx", "cy")
"""EasySynth 1.0 and 1.1: metres, x right, y down, z forward (its README), intrinsics in pixels."""


class PosedLens(NamedTuple):
    """One line of CameraPoses.csv, or one camera of CameraRig.json."""

    pose: Float64Array
    """4x4, camera to world (of a rig's camera: to the rig), OpenCV axes, metres."""
    lens: Lens | None
    """None: the line does not say it (EasySynth 1.2 and later), CameraRig.json does."""


def read_poses(path: Path) -> dict[int, PosedLens]:
    """The poses of a CameraPoses.csv by frame id, in the file's order; the header names the dialect.

    Raises FileError naming line and column: an unknown header, a value that is no finite number, an id given twice, a
    quaternion whose length is not 1, no pose at all.
    """
    rows = read_rows(path, commas=True, text=unreal_text(path))
    header = rows[0].words if rows else ()
    read = {UNREAL_HEADER: _unreal_pose, METRIC_HEADER: _metric_pose}.get(header)
    if read is None:
        raise FileError(
            f"{path}:1:1: the header is '{','.join(header)[:80]}'; '{','.join(UNREAL_HEADER)}' (EasySynth 1.2 and later) "
            f"or '{','.join(METRIC_HEADER)}' (1.0, 1.1) is expected"
        )
    poses: dict[int, PosedLens] = {}
    for row in rows[1:]:
        row.need(len(header), ",".join(header))
        identity = row.whole(0)
        if identity in poses:
            raise FileError(f"{row.at(0)}: id is {identity} for the second time; every frame has one line")
        poses[identity] = read(row)
    if not poses:
        raise FileError(f"{path}:2:1: there is no pose; a line per frame is expected")
    return poses


def read_rig(path: Path) -> dict[str, PosedLens]:
    """The cameras of a CameraRig.json by name ("ROS JSON": cm, Unreal axes); the last intrinsic may be 0, as EasySynth writes.

    Raises FileError (no JSON: with line and column; a field missing), CameraError (a value that cannot be).
    """
    fields = json_fields(path, unreal_text(path))
    cameras = fields.part("cameras", fields.values.get("cameras") or None)
    return {name: _rig_camera(fields.part(f"cameras.{name}", each)) for name, each in cameras.values.items()}


def opencv_pose(translation_cm: ArrayLike, rotation: Float64Array) -> Float64Array:
    """4x4 camera to world in OpenCV axes and metres, from Unreal's translation and its rotation (3x3)."""
    turned = OPENCV_FROM_UNREAL @ rotation @ OPENCV_FROM_UNREAL.T
    return make_pose(turned, OPENCV_FROM_UNREAL @ np.asarray(translation_cm, np.float64) / CENTIMETRES)


def unreal_pose(world_from_cam: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Unreal's translation (cm) and quaternion (xyzw) of a 4x4 pose in OpenCV axes and metres."""
    rotation = OPENCV_FROM_UNREAL.T @ world_from_cam[:3, :3] @ OPENCV_FROM_UNREAL
    return OPENCV_FROM_UNREAL.T @ world_from_cam[:3, 3] * CENTIMETRES, quaternion_from_rotation(rotation)


def _unreal_pose(row: Row) -> PosedLens:
    *translation, _ = _numbers(row, UNREAL_HEADER, "tx", "ty", "tz", "t")
    return PosedLens(opencv_pose(translation, _rotation(row, UNREAL_HEADER)), None)


def _metric_pose(row: Row) -> PosedLens:
    pose = make_pose(_rotation(row, METRIC_HEADER), _numbers(row, METRIC_HEADER, "tx", "ty", "tz"))
    names = ("fx", "fy", "cx", "cy")
    intrinsics = _numbers(row, METRIC_HEADER, *names)
    for name, value in zip(names, intrinsics):
        if value <= 0:
            raise FileError(
                f"{row.at(METRIC_HEADER.index(name))}: {name} is {value:g}; a number of pixels > 0 is expected"
            )
    fx, fy, cx, cy = intrinsics
    hw = max(1, round(2 * cy)), max(1, round(2 * cx))  # cx, cy are written as half the picture
    return PosedLens(pose, Lens(str(row.path), (fx, fy, cx, cy), 0.5, hw, scales=True))


def _numbers(row: Row, header: tuple[str, ...], *names: str) -> list[float]:
    """The values of these columns."""
    return [row.number(header.index(name)) for name in names]


def _rotation(row: Row, header: tuple[str, ...]) -> Float64Array:
    return rotation_at(row.at(header.index("qx")), _numbers(row, header, "qx", "qy", "qz", "qw"))


def _rig_camera(fields: FileFields) -> PosedLens:
    where, values = fields.path, fields.values
    fx, skew, cx, below, fy, cy, left, under, last = fields.numbers("intrinsics", 9)
    if any((skew, below, left, under)) or last not in (0, 1) or min(fx, fy) <= 0:
        raise CameraError(
            f"{where}.intrinsics is {values['intrinsics']}; fx 0 cx 0 fy cy 0 0 0 (or 1 at the end) is expected, fx, fy > 0"
        )
    rotation = rotation_at(f"{where}.rotation", fields.numbers("rotation", 4))
    width, height = fields.numbers("sensor_size", 2)
    if width < 1 or height < 1:
        raise CameraError(f"{where}.sensor_size is {values['sensor_size']}; width and height >= 1 are expected")
    lens = Lens(str(where), (fx, fy, cx, cy), 0.5, (round(height), round(width)), scales=True)
    return PosedLens(opencv_pose(fields.numbers("translation", 3), rotation), lens)
