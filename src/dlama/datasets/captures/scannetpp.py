"""ScanNet++ iPhone recordings in (pose_intrinsic_imu.json, rgb.mkv or rgb/, depth.bin or depth/); posed frames and cases out.

The JSON has for each picture of the video, frame_000000 and on, `intrinsic` (3x3) and `aligned_pose` (4x4, camera to world,
OpenCV axes, metres). depth.bin: 192 x 256, for each picture its size in bytes (4, little endian) and a block: 16-bit
millimetres by LZ4, or float32 metres by zlib; in old releases one zlib stream of all. depth/frame_000000.png are 16-bit
millimetres. No confidence is released. Format: github.com/scannetpp/scannetpp, iphone/prepare_iphone_data.py and
iphone/arkit_pcl.py.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dlama.datasets.posed.lenses import Lens
from dlama.datasets.posed.posed_frames import Listed, lidar_frame
from dlama.datasets.text_tables import files_by_stem, natural_order, pose_at
from dlama.errors import CameraError, FileError, any_error, import_extra
from dlama.files.fields import read_json_fields
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.images import existing_file
from dlama.files.rasters.pictures import read_color_of_camera
from dlama.files.rasters.video_frames import read_video_frame, video_times
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.writing.unchanged import while_unchanged

POSES, FOLDER = "pose_intrinsic_imu.json", "iphone"
VIDEOS = ("rgb.mkv", "rgb.mp4")
HW = (192, 256)
"""Of the depth in depth.bin."""
LONGEST = 4 << 30
"""Bytes that a depth.bin of one stream may unpack to: 21,800 pictures."""


def looks_like(root: Path) -> bool:
    """True where a folder holds the JSON, or iphone/ in it does."""
    return any((root / inside / POSES).is_file() for inside in ("", FOLDER))


def list_frames(folder: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    inside = folder if (folder / POSES).is_file() else folder / FOLDER
    listed = read_json_fields(inside / POSES)
    colors, depths = _pictures(inside), _depths(inside)
    for name in sorted(listed.values, key=natural_order):
        number = name.rpartition("_")[2]
        if not number.isdecimal():
            raise FileError(f"{listed.path}: field '{name[:40]}' is no frame; names such as frame_000000 are expected")
        fields = listed.part(name, listed.values[name])
        key = _name(int(number))
        picture, metres = colors.get(key), depths.get(key)
        matrix = None
        with suppress(CameraError):
            matrix = fields.matrix("aligned_pose", (4, 4))
        if matrix is None:
            yield name, "without a pose"
        elif picture is None:
            yield name, "without a picture"
        elif metres is None:
            yield name, "without depth"
        else:
            pose = pose_at(f"{fields.path}: aligned_pose", matrix)
            lens = Lens(str(fields.path), fields.intrinsics("intrinsic"), 0.5)
            names = f"{inside}, picture {name}", f"{inside}, depth {name}"
            yield name, lidar_frame(names, picture, metres, lens, pose)


def _pictures(folder: Path) -> dict[str, Callable[[], UInt8Array]]:
    """Name of a frame -> how its picture is read."""
    extracted = folder / "rgb"
    if extracted.is_dir():
        return _readers(extracted, (".jpg", ".png"), read_color_of_camera)
    video = next((folder / name for name in VIDEOS if (folder / name).is_file()), None)
    if video is None:
        raise FileError(f"{folder}: has neither rgb/ nor {' nor '.join(VIDEOS)} with the colour pictures")
    return {_name(number): partial(read_video_frame, video, number) for number in range(len(video_times(video)))}


def _depths(folder: Path) -> dict[str, Callable[[], Float32Array]]:
    """Name of a frame -> how its depth is read."""
    if (folder / "depth").is_dir():
        return _readers(folder / "depth", (".png",), read_depth)
    path = existing_file(folder / "depth.bin")
    return {_name(number): partial(depth_of_bin, path, number) for number in range(len(_blocks(path)))}


def _readers(folder: Path, suffixes: Sequence[str], read: Callable[[Path], Any]) -> dict[str, Callable[[], Any]]:
    return {name: partial(read, path) for name, path in files_by_stem(folder, suffixes).items()}


def _name(number: int) -> str:
    return f"frame_{number:06d}"


def depth_of_bin(path: Path, number: int) -> Float32Array:
    """The depth of one frame, 192 x 256 metres. FileError, MissingExtraError."""
    place, size = _blocks(path)[number]
    if size < 0:  # one stream of all
        return _whole(path)[number]
    with path.open("rb") as stream:
        stream.seek(place)
        block = stream.read(size)
    try:
        return _array(path, zlib.decompress(block, wbits=-zlib.MAX_WBITS), np.float32)[0]
    except zlib.error:
        pass
    lz4 = import_extra("lz4.block", f"{path}: depth packed by LZ4", "lz4", "captures")
    with any_error(FileError, f"{path}: the depth of frame {number} is damaged"):
        codes = lz4.decompress(block, uncompressed_size=HW[0] * HW[1] * 2)
    return _array(path, codes, np.uint16)[0].astype(np.float32) / np.float32(1000)


@while_unchanged(keep=4)
def _blocks(path: Path) -> list[tuple[int, int]]:
    """Place and size of each frame's block; sizes of -1 where all frames are one stream."""
    total, at, found = path.stat().st_size, 0, list[tuple[int, int]]()
    with path.open("rb") as stream:
        while at + 4 <= total:
            stream.seek(at)
            size = int.from_bytes(stream.read(4), "little")
            found.append((at + 4, size))
            at += 4 + size
    return found if at == total else [(0, -1)] * len(_whole(path))


@while_unchanged(keep=1)
def _whole(path: Path) -> Float32Array:
    stream = zlib.decompressobj(wbits=-zlib.MAX_WBITS)
    with any_error(FileError, f"{path}: is neither a row of packed depth pictures nor one packed stream"):
        data = stream.decompress(path.read_bytes(), LONGEST)
    if stream.unconsumed_tail or not stream.eof:
        raise FileError(f"{path}: {'unpacks to more than 4 GB' if stream.unconsumed_tail else 'is cut short'}")
    return _array(path, data, np.float32)


def _array(path: Path, data: bytes, kind: type[np.generic]) -> np.ndarray:
    size = HW[0] * HW[1] * np.dtype(kind).itemsize
    if not data or len(data) % size:
        raise FileError(f"{path}: a depth picture has {len(data)} bytes; {size} are expected ({HW[1]}x{HW[0]})")
    return np.frombuffer(data, kind).reshape(-1, *HW)
