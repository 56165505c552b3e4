"""PFM, NPY, NPZ and COLMAP's depth files in; one H x W array of numbers out, as stored; and PFM back. No units."""

from __future__ import annotations

import math
import re
import zipfile
from pathlib import Path
from typing import IO

import numpy as np

from dlama.errors import FileError, any_error, format_size, system_errors
from dlama.files.rasters.images import LARGEST_PIXELS, check_pixels, existing_file
from dlama.geometry.rgbd import Float32Array
from dlama.writing.atomic_write import PathLike, write_file

PFM_HEADER = re.compile(rb"(P[Ff])\s+(\d{1,18})\s+(\d{1,18})\s+([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?:\r\n|\s)")
HEADER_BYTES = 512
"""The longest header that is looked at."""
COLMAP_HEAD = re.compile(rb"(\d{1,9})&(\d{1,9})&(\d{1,9})&")
"""Width, height, channels; then float32, little-endian, row by row."""


def read_pfm(path: PathLike) -> Float32Array:
    """A one-channel PFM as float32 H x W, first row on top, numbers as stored.

    Rows lie bottom-up in the file; the sign of its scale is the byte order, its size is not applied (writers use it for
    display only, as Middlebury does). Raises FileError.
    """
    file = existing_file(path)
    with file.open("rb") as stream:
        head = PFM_HEADER.match(stream.read(HEADER_BYTES))
    if head is None:
        raise FileError(f"{file}: is no PFM picture (header 'Pf', width, height, scale is expected)")
    kind, width, height, scale = head[1], int(head[2]), int(head[3]), float(head[4])
    if kind == b"PF":
        raise FileError(f"{file}: is a colour PFM (PF); one channel (Pf) is expected")
    if width < 1 or height < 1 or scale == 0 or not math.isfinite(scale):
        raise FileError(f"{file}: says {width}x{height}, scale {scale}; positive sizes and a scale are expected")
    return _numbers(file, head.end(), (height, width), "<f4" if scale < 0 else ">f4")[::-1].astype(np.float32)


def _numbers(file: Path, start: int, hw: tuple[int, int], kind: str) -> np.ndarray:
    """H x W numbers of four bytes, all that a file holds from `start` on. FileError."""
    check_pixels(file, hw[1], hw[0])
    held, expected = file.stat().st_size - start, 4 * hw[0] * hw[1]
    if held != expected:
        raise FileError(
            f"{file}: is damaged or truncated ({held} bytes of numbers, {format_size(hw)} needs {expected})"
        )
    return np.fromfile(file, kind, offset=start).reshape(hw)


def write_pfm(path: PathLike, values: Float32Array) -> None:
    """Write float H x W as a little-endian one-channel PFM (bottom-up rows, scale -1). Raises OutputError."""
    head = f"Pf\n{values.shape[1]} {values.shape[0]}\n-1.0\n".encode()
    write_file(path, head + np.ascontiguousarray(values[::-1], "<f4").tobytes())


@system_errors(FileError)
def read_colmap_depth(path: PathLike) -> Float32Array:
    """A depth map of COLMAP's dense workspace (`NAME.geometric.bin`): planar depth in the unit of the model; what is not positive
    is missing (0). Raises FileError."""
    file = existing_file(path)
    with file.open("rb") as stream:
        head = COLMAP_HEAD.match(stream.read(HEADER_BYTES))
    if head is None:
        raise FileError(f"{file}: is no depth map of COLMAP, which begins with WIDTH&HEIGHT&CHANNELS&")
    width, height, channels = (int(one) for one in head.groups())
    if channels != 1:
        raise FileError(f"{file}: has {channels} channels; a depth map has 1")
    depth = _numbers(file, head.end(), (height, width), "<f4").astype(np.float32)
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))


def read_array(path: PathLike, key: str) -> np.ndarray:
    """The H x W array of an NPY, or of an NPZ: the one called `key`, else the only one. Raises FileError."""
    file = existing_file(path)
    with any_error(FileError, f"{file}: is no whole NPY or NPZ file"), file.open("rb") as stream:
        if stream.read(2) != b"PK":
            stream.seek(0)
            return plane_of(file, read_npy(stream, file.stat().st_size, file))
        with zipfile.ZipFile(stream) as archive:
            parts = {part.filename.removesuffix(".npy"): part for part in archive.infolist()}
            if key not in parts and len(parts) != 1:
                raise FileError(
                    f"{file}: holds {', '.join(parts)[:200] or 'nothing'}; an array called '{key}' is expected"
                )
            part = parts[key if key in parts else next(iter(parts))]
            with archive.open(part) as entry:
                return plane_of(file, read_npy(entry, part.file_size, file))


def read_npy(stream: IO[bytes], held: int, where: PathLike) -> np.ndarray:
    """The array of an NPY of `held` bytes; its header is believed only where it fits them, and bounds what is read.

    FileError, which begins with `where`: an array of objects, of more than LARGEST_PIXELS x 4 numbers, or of another size than is
    there; what numpy raises for headers that are none.
    """
    version = np.lib.format.read_magic(stream)
    if version not in ((1, 0), (2, 0)):
        raise FileError(f"{where}: is an NPY of version {version}; 1.0 or 2.0 is expected")
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = read_header(stream)
    count = math.prod(shape)
    if dtype.hasobject:
        raise FileError(f"{where}: holds Python objects; numbers are expected")
    if min((0, *shape)) < 0 or count > 4 * LARGEST_PIXELS:
        raise FileError(
            f"{where}: says it holds an array of shape {shape}; at most {4 * LARGEST_PIXELS} numbers are read"
        )
    expected = count * dtype.itemsize
    if expected > held:
        raise FileError(
            f"{where}: is damaged or truncated ({held} bytes, an array {shape} of {dtype} needs {expected})"
        )
    data = stream.read(expected)
    if len(data) != expected:
        raise FileError(f"{where}: is damaged or truncated ({len(data)} bytes of numbers, {expected} are expected)")
    array = np.frombuffer(data, dtype, count)
    return array.reshape(shape[::-1]).T if by_columns else array.reshape(shape)


def plane_of(file: Path, array: np.ndarray) -> np.ndarray:
    """The numbers of a file as H x W, contiguous and in the byte order of this machine; False is 0, True 1. FileError."""
    if array.dtype == np.bool_:
        array = array.astype(np.uint8)
    if array.dtype.kind not in "uif":
        raise FileError(f"{file}: holds {array.dtype} values; numbers are expected")
    if array.ndim == 3 and 1 in (array.shape[0], array.shape[2]):
        array = array[0] if array.shape[0] == 1 else array[..., 0]
    if array.ndim != 2 or array.size == 0:
        raise FileError(f"{file}: holds an array of shape {array.shape}; H x W is expected")
    check_pixels(file, array.shape[1], array.shape[0])
    return np.ascontiguousarray(array.astype(array.dtype.newbyteorder("="), copy=False))
