"""A .safetensors file in -> named numpy arrays out, and back; numpy alone, nothing is ever run from the file.

The format (huggingface/safetensors): 8 bytes little-endian header length, a JSON header with dtype, shape and byte
offsets of each tensor, then the bytes.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import FileError, OutputError
from dlama.nets.whole_file import write_whole

DTYPES = {
    "F64": np.float64, "F32": np.float32, "F16": np.float16, "BF16": np.uint16,
    "I64": np.int64, "I32": np.int32, "I16": np.int16, "I8": np.int8, "U8": np.uint8, "BOOL": np.bool_,
}  # fmt: skip
MOST_SIDES = 32
"""Dimensions of a tensor."""
LONGEST_HEADER = 100_000_000


def read_safetensors(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str], dict[str, str]]:
    """Every tensor of the file, its dtype as the file says it, and the file's own metadata.

    Returns:
        name -> array (BF16 widened to float32, everything else as stored), name -> "F32", "F16", "BF16", ...,
        and the strings under `__metadata__`.
    Raises:
        FileError: truncated, no safetensors at all, or a header that does not fit the bytes.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error})") from error
    header, start = _header(path, data)
    notes = header.pop("__metadata__", {})
    if not isinstance(notes, dict) or not all(isinstance(value, str) for value in notes.values()):
        raise FileError(f"{path}: the header's __metadata__ is not a table of strings")
    arrays = {name: _tensor(path, data, start, name, entry) for name, entry in header.items()}
    if sum(array.nbytes for array in arrays.values()) > 2 * len(data):  # bfloat16 doubles
        raise FileError(f"{path}: its tensors overlap; each has bytes of its own in a safetensors file")
    return arrays, {name: entry["dtype"] for name, entry in header.items()}, notes


def write_safetensors(path: Path, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str] | None = None) -> None:
    """Write float and integer arrays as they are; written beside and moved, so that no half file is ever left.

    Raises:
        OutputError: a dtype the format does not know, or a folder that cannot be written.
    """
    codes = {np.dtype(kind).str: code for code, kind in DTYPES.items() if code != "BF16"}
    header: dict[str, Any] = {"__metadata__": dict(metadata)} if metadata else {}
    blobs, end = [], 0
    for name, array in tensors.items():
        if array.dtype.str not in codes:
            raise OutputError(f"{path}: {name} is {array.dtype}, which safetensors does not hold")
        blobs.append(np.ascontiguousarray(array).tobytes())
        header[name] = {
            "dtype": codes[array.dtype.str],
            "shape": list(array.shape),
            "data_offsets": [end, end + len(blobs[-1])],
        }
        end += len(blobs[-1])
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    write_whole(path, b"".join([struct.pack("<Q", len(text)), text, *blobs]))


def looks_like_safetensors(head: bytes) -> bool:
    """Whether a file that begins with these 9 bytes or more can be safetensors: a length, then a JSON object."""
    return len(head) >= 9 and struct.unpack("<Q", head[:8])[0] <= LONGEST_HEADER and head[8:9] == b"{"


def _header(path: Path, data: bytes) -> tuple[dict[str, Any], int]:
    if not looks_like_safetensors(data[:9]):
        raise FileError(f"{path}: no safetensors file (it begins with {data[:9]!r})")
    start = 8 + int(struct.unpack("<Q", data[:8])[0])
    if start > len(data):
        raise FileError(f"{path}: truncated, the header alone needs {start} bytes and the file has {len(data)}")
    try:
        header = json.loads(data[8:start])
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path}: the safetensors header is no JSON ({error})") from error
    if not isinstance(header, dict):
        raise FileError(f"{path}: the safetensors header is a {type(header).__name__}, wanted a table")
    return header, start


def _tensor(path: Path, data: bytes, start: int, name: str, entry: Any) -> np.ndarray:
    try:
        dtype, shape = np.dtype(DTYPES[entry["dtype"]]), tuple(entry["shape"])
        begin, end = entry["data_offsets"]
        if len(shape) > MOST_SIDES or any(
            type(number) is not int or abs(number) >= 2**63 for number in (*shape, begin, end)
        ):
            raise TypeError("counts are whole numbers")
    except (KeyError, TypeError, ValueError) as error:
        shown = repr(entry)[:200]
        raise FileError(f"{path}: {name[:200]}: header entry {shown} has no known dtype, shape and offsets") from error
    wanted = math.prod(shape) * dtype.itemsize
    if min((begin, *shape)) < 0 or end - begin != wanted:
        raise FileError(f"{path}: {name}: {end - begin} bytes for shape {str(shape)[:200]}, wanted {wanted}")
    if start + end > len(data):
        raise FileError(f"{path}: truncated at {name}: {start + end} bytes wanted, the file has {len(data)}")
    try:
        array = np.frombuffer(data, dtype, math.prod(shape), start + begin).reshape(shape)
    except ValueError as error:  # without any number, and yet of more than memory addresses: (0, 2**62, 2**62)
        raise FileError(f"{path}: {name}: no array has shape {str(shape)[:200]} ({error})") from error
    return widen_bfloat16(array) if entry["dtype"] == "BF16" else array


def widen_bfloat16(bits: np.ndarray) -> np.ndarray:
    """uint16 bit patterns of bfloat16 -> the same numbers as float32, exactly."""
    return (bits.astype(np.uint32) << 16).view(np.float32)
