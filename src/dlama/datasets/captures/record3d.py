"""Record3D recordings in (a .r3d file, or the folder it was unpacked into); posed frames and the cases between them out.

A .r3d file is a ZIP: `metadata` (JSON) and rgbd/N.jpg, N.depth, N.conf. metadata: w, h, dw, dh; K, column by column, for w x h;
perFrameIntrinsicCoeffs [fx, fy, cx, cy]; poses [qx, qy, qz, qw, x, y, z], camera to world in metres, ARKit's axes. Depth is
float32 metres and confidence uint8, 0 to 2, both dh x dw and packed by LZFSE (extra `captures`). Format: the reader of
github.com/codekansas/usa, usa/tasks/datasets/r3d.py, and nerfstudio's record3d_utils.py; record3d.app publishes none.
"""

from __future__ import annotations

import zipfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dlama.datasets.posed.lenses import Lens
from dlama.datasets.posed.nerfstudio import CV_FROM_GL
from dlama.datasets.posed.posed_frames import Listed, lidar_frame
from dlama.datasets.text_tables import holds, pose_of
from dlama.errors import FileError, any_error, format_size, import_extra
from dlama.files.fields import FileFields, json_fields
from dlama.files.rasters.images import check_pixels, picture_of_bytes
from dlama.geometry.rgbd import UInt8Array

META, INSIDE = "metadata", "rgbd"
looks_like = holds(META, INSIDE)
MOST_BYTES = 2**28
"""Of one member of the file."""


def list_frames(place: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    fields = json_fields(f"{place}: {META}", read_member(place, META).decode("utf-8", "replace"))
    poses, size = fields.entries("poses", "poses"), (fields.count("h"), fields.count("w"))
    depth_hw = (fields.count("dh"), fields.count("dw"))
    check_pixels(fields.path, *depth_hw)
    present = _members(place)
    for number, pose in enumerate(poses):
        color, depth, levels = (f"{INSIDE}/{number}.{kind}" for kind in ("jpg", "depth", "conf"))
        name = f"{number:06d}"
        if color not in present:
            yield name, "without a picture"
            continue
        if depth not in present:
            yield name, "without depth"
            continue
        numbers = FileFields(fields.path, {"pose": pose}).numbers("pose", 7)
        files = lidar_frame(
            (f"{place}: {color}", f"{place}: {depth}"),
            partial(color_of_member, place, color),
            partial(array_of_member, place, depth, "<f4", depth_hw),
            _lens(fields, number, size),
            pose_of(f"{fields.path}: poses[{number}]", numbers[4:], numbers[:4]) @ CV_FROM_GL,
            confidence=partial(array_of_member, place, levels, "u1", depth_hw) if levels in present else None,
        )
        yield name, files


def _lens(fields: FileFields, number: int, hw: tuple[int, int]) -> Lens:
    each = fields.values.get("perFrameIntrinsicCoeffs")
    if isinstance(each, list) and number < len(each):
        row = FileFields(fields.path, {"perFrameIntrinsicCoeffs": each[number]})
        fx, fy, cx, cy = row.numbers("perFrameIntrinsicCoeffs", 4)
        return Lens(str(fields.path), (fx, fy, cx, cy), 0.5, hw)
    K = FileFields(fields.path, {"K": np.reshape(fields.numbers("K", 9), (3, 3)).T})
    return Lens(str(fields.path), K.intrinsics("K"), 0.5, hw)


def color_of_member(place: Path, name: str) -> UInt8Array:
    """H x W x 3 RGB of a JPEG in the file. FileError."""
    return np.asarray(picture_of_bytes(read_member(place, name), f"{place}: {name}").convert("RGB"))


def array_of_member(place: Path, name: str, kind: str, hw: tuple[int, int]) -> Any:
    """h x w numbers that are packed by LZFSE. FileError, MissingExtraError."""
    lzfse = import_extra("lzfse", f"{place}: depth packed by LZFSE", "lzfse", "captures")
    with any_error(FileError, f"{place}: {name} is damaged"):
        data = lzfse.decompress(read_member(place, name))
    size = hw[0] * hw[1] * np.dtype(kind).itemsize
    if len(data) != size:
        raise FileError(f"{place}: {name} has {len(data)} bytes; {size} are expected ({format_size(hw)})")
    found = np.frombuffer(data, kind).reshape(hw)
    return found.astype(np.float32) if kind != "u1" else found


def read_member(place: Path, name: str) -> bytes:
    """The bytes of a member of the ZIP, or of a file in the folder. FileError."""
    if place.is_dir():
        with any_error(FileError, f"{place / name}: cannot be read"):
            return (place / name).read_bytes()
    with any_error(FileError, f"{place}: is no readable ZIP of Record3D"), zipfile.ZipFile(place) as archive:
        if archive.getinfo(name).file_size > MOST_BYTES:
            raise FileError(f"{place}: {name} says that it has more than {MOST_BYTES >> 20} MiB")
        return archive.read(name)


def _members(place: Path) -> set[str]:
    if place.is_dir():
        return {f"{INSIDE}/{path.name}" for path in (place / INSIDE).iterdir()}
    with zipfile.ZipFile(place) as archive:
        return set(archive.namelist())
