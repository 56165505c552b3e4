"""EXR, PFM, NPY, NPZ and COLMAP's depth files in; one H x W array of numbers out, as stored; and PFM and EXR back. No units."""

from __future__ import annotations

import io
import math
import re
import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import OpenEXR

from dlama.errors import FileError, ShapeError, any_error, first_line, system_errors
from dlama.files.atomic_write import PathLike, new_file
from dlama.files.rasters.images import LARGEST_PIXELS, check_pixels, existing_file
from dlama.geometry.rgbd import Float32Array

PFM_HEADER = re.compile(rb"(P[Ff])\s+(\d{1,18})\s+(\d{1,18})\s+([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?:\r\n|\s)")
PFM_HEADER_BYTES = 512
"""The longest header that is looked at."""
HALF_MAX = 65504.0
"""The largest half float; where a writer clamps, this is what infinity becomes."""
COLMAP_HEAD = re.compile(rb"(\d{1,9})&(\d{1,9})&(\d{1,9})&")
"""Width, height, channels; then float32, little-endian, row by row."""
CHANNEL_ORDER = ("z", "depth", "*.z", "*depth*", "r", "y")
"""Which channel of an EXR is depth: the first of these that is there (without regard to case), else the only one."""


def read_pfm(path: PathLike) -> Float32Array:
    """A one-channel PFM as float32 H x W, first row on top, numbers as stored.

    Rows lie bottom-up in the file; the sign of its scale is the byte order, its size is not applied (writers use it for
    display only, as Middlebury does). Raises FileError.
    """
    file = existing_file(path)
    with file.open("rb") as stream:
        head = PFM_HEADER.match(stream.read(PFM_HEADER_BYTES))
    if head is None:
        raise FileError(f"{file}: is no PFM picture (header 'Pf', width, height, scale is expected)")
    kind, width, height, scale = head[1], int(head[2]), int(head[3]), float(head[4])
    if kind == b"PF":
        raise FileError(f"{file}: is a colour PFM (PF); one channel (Pf) is expected")
    if width < 1 or height < 1 or scale == 0 or not math.isfinite(scale):
        raise FileError(f"{file}: says {width}x{height}, scale {scale}; positive sizes and a scale are expected")
    check_pixels(file, width, height)
    held, expected = file.stat().st_size - head.end(), 4 * width * height
    if held != expected:
        raise FileError(f"{file}: is damaged or truncated ({held} bytes of numbers, {width}x{height} needs {expected})")
    numbers = np.fromfile(file, "<f4" if scale < 0 else ">f4", offset=head.end(), count=width * height)
    return numbers.reshape(height, width)[::-1].astype(np.float32)


def write_pfm(path: PathLike, values: Float32Array) -> None:
    """Write float H x W as a little-endian one-channel PFM (bottom-up rows, scale -1). Raises OutputError."""
    if values.ndim != 2:
        raise ShapeError(f"{path}: values have shape {values.shape}; H x W is expected")
    head = f"Pf\n{values.shape[1]} {values.shape[0]}\n-1.0\n".encode()
    with new_file(path) as draft:
        draft.write_bytes(head + np.ascontiguousarray(values[::-1], "<f4").tobytes())


@system_errors(FileError)
def read_colmap_depth(path: PathLike) -> Float32Array:
    """A depth map of COLMAP's dense workspace (`NAME.geometric.bin`): planar depth in the unit of the model; what is not positive
    is missing (0). Raises FileError."""
    file = existing_file(path)
    data = file.read_bytes()
    head = COLMAP_HEAD.match(data)
    if head is None:
        raise FileError(f"{file}: is no depth map of COLMAP, which begins with WIDTH&HEIGHT&CHANNELS&")
    width, height, channels = (int(one) for one in head.groups())
    if channels != 1:
        raise FileError(f"{file}: has {channels} channels; a depth map has 1")
    check_pixels(file, width, height)
    if len(data) - head.end() != 4 * width * height:
        raise FileError(
            f"{file}: holds {len(data) - head.end()} bytes; {width}x{height} pixels take {4 * width * height}"
        )
    depth = np.frombuffer(data, "<f4", offset=head.end()).reshape(height, width).astype(np.float32)
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))


def read_array(path: PathLike, key: str) -> np.ndarray:
    """The H x W array of an NPY, or of an NPZ: the one called `key`, else the only one. Raises FileError."""
    file = existing_file(path)
    try:
        with file.open("rb") as stream:
            if stream.read(2) != b"PK":
                stream.seek(0)
                return _plane(file, read_npy(stream, file.stat().st_size))
        with zipfile.ZipFile(file) as archive:
            parts = {part.filename.removesuffix(".npy"): part for part in archive.infolist()}
            if key not in parts and len(parts) != 1:
                raise FileError(
                    f"{file}: holds {', '.join(parts)[:200] or 'nothing'}; an array called '{key}' is expected"
                )
            part = parts[key if key in parts else next(iter(parts))]
            with archive.open(part) as stream:
                return _plane(file, read_npy(stream, part.file_size))
    except FileError as error:
        raise error if str(error).startswith(str(file)) else FileError(f"{file}: {error}") from error
    except Exception as error:  # ValueError, EOFError, BadZipFile, zlib.error, ...
        raise FileError(f"{file}: is no whole NPY or NPZ file ({first_line(error)})") from error


def read_npy(stream: IO[bytes], held: int) -> np.ndarray:
    """The array of an NPY of `held` bytes; its header is believed only where it fits them, and bounds what is read.

    FileError: an array of objects, of more than LARGEST_PIXELS x 4 numbers, or of another size than is there; what numpy
    raises for headers that are none.
    """
    version = np.lib.format.read_magic(stream)
    if version not in ((1, 0), (2, 0)):
        raise FileError(f"is an NPY of version {version}; 1.0 or 2.0 is expected")
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = read_header(stream)
    count = math.prod(shape)
    if dtype.hasobject:
        raise FileError("holds Python objects; numbers are expected")
    if min((0, *shape)) < 0 or count > 4 * LARGEST_PIXELS:
        raise FileError(f"says it holds an array of shape {shape}; at most {4 * LARGEST_PIXELS} numbers are read")
    expected = count * dtype.itemsize
    if expected > held:
        raise FileError(f"is damaged or truncated ({held} bytes, an array {shape} of {dtype} needs {expected})")
    data = stream.read(expected)
    if len(data) != expected:
        raise FileError(f"is damaged or truncated ({len(data)} bytes of numbers, {expected} are expected)")
    array = np.frombuffer(data, dtype, count)
    return array.reshape(shape[::-1]).T if by_columns else array.reshape(shape)


def _plane(file: Path, array: np.ndarray) -> np.ndarray:
    if array.dtype.kind not in "uif":
        raise FileError(f"{file}: holds {array.dtype} values; numbers are expected")
    if array.ndim == 3 and 1 in (array.shape[0], array.shape[2]):
        array = array[0] if array.shape[0] == 1 else array[..., 0]
    if array.ndim != 2 or array.size == 0:
        raise FileError(f"{file}: holds an array of shape {array.shape}; H x W is expected")
    check_pixels(file, array.shape[1], array.shape[0])
    return np.ascontiguousarray(array.astype(array.dtype.newbyteorder("="), copy=False))


def read_exr(path: PathLike, channel: str | None = None) -> Float32Array:
    """One channel of an OpenEXR file as float32 H x W; half infinity (or a half clamped at its largest) is +inf.

    `channel` is the exact name; None looks for depth (CHANNEL_ORDER). Raises FileError.
    """
    file = existing_file(path)
    check_exr_is_whole(file)
    with (
        any_error(FileError, f"{file}: is damaged or no OpenEXR file"),
        OpenEXR.File(_name_or_bytes(file), separate_channels=True) as exr,
    ):
        channels: dict[str, np.ndarray] = {}
        for part in exr.parts:
            channels.update({name: each.pixels for name, each in part.channels.items() if name not in channels})
        header: dict[str, Any] = exr.parts[0].header
        _check_windows(file, header)
        values = np.array(channels[_depth_channel(file, channels, channel)])
    result = _plane(file, values).astype(np.float32)
    if values.dtype == np.float16:
        result[result >= HALF_MAX] = np.inf
    return result


def write_exr(path: PathLike, channels: Mapping[str, np.ndarray]) -> None:
    """Write channels (each float32 or half H x W) as an OpenEXR file, compressed without loss (PIZ). Raises OutputError."""
    header = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    with new_file(path) as draft:
        try:
            planes = {name: np.ascontiguousarray(values) for name, values in channels.items()}
            place = _name_or_bytes(draft)
            OpenEXR.File(header, planes).write(place)
            if isinstance(place, io.BytesIO):
                draft.write_bytes(place.getbuffer())
        except (RuntimeError, TypeError) as error:  # how OpenEXR reports a full disk, and no stream before 3.5
            raise OSError(str(error)) from error


def _name_or_bytes(file: Path) -> str | io.BytesIO:
    """What OpenEXR takes for a file: its name, or its bytes where the name is no text."""
    try:
        str(file).encode()
    except UnicodeEncodeError:
        return io.BytesIO(file.read_bytes())
    return str(file)


def _check_windows(file: Path, header: dict[str, Any]) -> None:
    data, display = (np.asarray(header[name]).ravel().tolist() for name in ("dataWindow", "displayWindow"))
    if data != display:
        raise FileError(f"{file}: is cropped or has overscan (data {data}, display {display}); save it without")


def _depth_channel(file: Path, channels: dict[str, np.ndarray], expected: str | None) -> str:
    """Which channel holds depth; refuses a colour picture."""
    known = ", ".join(sorted(channels))
    if expected is not None:
        if expected not in channels:
            raise FileError(f"{file}: has no channel '{expected}'; it has {known}")
        return expected
    for rule in CHANNEL_ORDER:
        fits = [name for name in channels if _fits(name.lower(), rule)]
        if len(fits) > 1:
            raise FileError(f"{file}: depth may be any of {', '.join(fits)}; choose one with `channel`")
        if fits:
            _check_grey(file, channels, fits[0])
            return fits[0]
    if len(channels) != 1:
        raise FileError(f"{file}: has the channels {known}, none of which is plainly depth; choose one with `channel`")
    return next(iter(channels))


def _fits(name: str, rule: str) -> bool:
    if rule.startswith("*"):
        return name.endswith(rule[1:]) if not rule.endswith("*") else rule.strip("*") in name
    return name == rule


def _check_grey(file: Path, channels: dict[str, np.ndarray], chosen: str) -> None:
    """R stands for depth only where G and B say the same (EasySynth writes all three)."""
    for other in {"R": "GB", "r": "gb"}.get(chosen, ""):
        if other in channels and not np.array_equal(channels[chosen], channels[other], equal_nan=True):
            raise FileError(f"{file}: is a colour picture (R and {other} differ); depth in one channel is expected")


def check_exr_is_whole(file: Path) -> None:
    """Raise FileError for a file that ends early; the library itself complains on the terminal before it raises.

    Only what is simple is checked here, one scan-line part (format: openexr.com, "OpenEXR File Layout"): behind the
    header lies a table of chunk offsets, at each offset a line number, a size and that many bytes.
    """
    data = file.read_bytes()
    if data[:4] != b"\x76\x2f\x31\x01":
        raise FileError(f"{file}: is no OpenEXR file")
    try:
        flags = struct.unpack_from("<I", data, 4)[0]
        if flags & 0x1A00:  # tiled, deep or of several parts: left to the library
            return
        table, chunks = _chunk_table(data)
        offsets = struct.unpack_from(f"<{chunks}Q", data, table)
        ends = [at + 8 + struct.unpack_from("<i", data, at + 4)[0] for at in offsets]
        whole = min(offsets) > table and max(ends) <= len(data)
    except (struct.error, ValueError, KeyError, IndexError, OverflowError):
        whole = False
    if not whole:
        raise FileError(f"{file}: is damaged or truncated")


LINES_PER_CHUNK = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}
"""By compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB."""


def _chunk_table(data: bytes) -> tuple[int, int]:
    """(where the table of chunk offsets begins, how many there are) of a scan-line EXR."""
    at, found = 8, {}
    while data[at]:
        name_end = data.index(b"\0", at)
        type_end = data.index(b"\0", name_end + 1)
        size = struct.unpack_from("<i", data, type_end + 1)[0]
        found[data[at:name_end]] = data[type_end + 5 : type_end + 5 + size]
        at = type_end + 5 + size
    _, top, _, bottom = struct.unpack("<4i", found[b"dataWindow"])
    lines = LINES_PER_CHUNK[found[b"compression"][0]]
    return at + 1, -(-(bottom - top + 1) // lines)
