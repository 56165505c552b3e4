"""A .safetensors file in -> named numpy arrays out, and back; the package `safetensors` reads and checks it, without torch."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, deserialize, safe_open
from safetensors.numpy import save

from dlama.errors import FileError, any_error
from dlama.writing.atomic_write import write_file

DTYPES = {
    "F64": np.float64, "F32": np.float32, "F16": np.float16, "BF16": np.uint16,
    "I64": np.int64, "I32": np.int32, "I16": np.int16, "I8": np.int8, "U8": np.uint8, "BOOL": np.bool_,
}  # fmt: skip
"""The format's names of dtypes that weights have; bfloat16, which numpy lacks, is read by its bits."""


def read_safetensors(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str], dict[str, str]]:
    """Every tensor of the file, its dtype as the file names it, and the file's own metadata.

    Returns:
        name -> array (BF16 widened to float32, everything else as stored), name -> "F32", "F16", "BF16", ...,
        and the strings under `__metadata__`.
    Raises:
        FileError: truncated, no safetensors at all, a header that does not fit the bytes, or a dtype that numpy lacks.
    """
    try:
        stored = dict(deserialize(path.read_bytes()))
        with safe_open(path, "numpy") as file:
            names, metadata = list(file.keys()), file.metadata() or {}
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error})") from error
    except SafetensorError as error:
        raise FileError(f"{path}: truncated, damaged or no safetensors file ({error})") from error
    arrays = {name: _array(path, name, **stored[name]) for name in names}
    return arrays, {name: stored[name]["dtype"] for name in names}, metadata


def write_safetensors(path: Path, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str] | None = None) -> None:
    """Write float and integer arrays as they are; the same arrays and metadata give the same bytes. OutputError, and no half file
    is left, where the folder takes none."""
    contiguous = {name: np.asarray(array, order="C") for name, array in tensors.items()}
    write_file(path, _sort_metadata(save(contiguous, dict(metadata) if metadata else None)))


def _sort_metadata(data: bytes) -> bytes:
    """The file with its metadata sorted by name: the package writes it in an order that differs from run to run."""
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    if "__metadata__" in header:
        header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text + data[8 + length :]


def _array(path: Path, name: str, dtype: str, shape: list[int], data: bytearray) -> np.ndarray:
    if dtype not in DTYPES:
        raise FileError(f"{path}: {name} holds {dtype}, expected one of {', '.join(DTYPES)}")
    with any_error(FileError, f"{path}: {name}: no array has shape {shape}"):  # as (0, 2**62, 2**62)
        array: np.ndarray = np.frombuffer(data, DTYPES[dtype]).reshape(shape)
    return widen_bfloat16(array) if dtype == "BF16" else array


def widen_bfloat16(bits: np.ndarray) -> np.ndarray:
    """uint16 bit patterns of bfloat16 -> the same numbers as float32, exactly."""
    return (bits.astype(np.uint32) << 16).view(np.float32)
