"""safetensors: arrays there and back, and files that are broken, large by claim only, or absent."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open

from dlama.errors import FileError, OutputError
from dlama.nets.safetensors_file import read_safetensors, write_safetensors

TENSORS = {
    "a": np.arange(6, dtype=np.float32).reshape(2, 3),
    "half": np.array([1.5, -2], np.float16),
    "scalar": np.array(7, np.int64),
    "none": np.zeros((0, 3), np.float32),
}


def test_round_trip(tmp_path):
    """Oracle: round trip, dtypes and metadata included."""
    write_safetensors(tmp_path / "w.safetensors", TENSORS, {"activation": "tanh"})
    arrays, codes, about = read_safetensors(tmp_path / "w.safetensors")
    assert set(arrays) == set(TENSORS) and about == {"activation": "tanh"}
    assert codes == {"a": "F32", "half": "F16", "scalar": "I64", "none": "F32"}
    for name, array in TENSORS.items():
        assert arrays[name].dtype == array.dtype
        np.testing.assert_array_equal(arrays[name], array)
    assert [path.name for path in tmp_path.iterdir()] == ["w.safetensors"]


def test_the_same_content_gives_the_same_bytes(tmp_path):
    """Law: whatever order the metadata comes in; somebody else's reader finds all of it."""
    tensors, about = {"weight": np.arange(6.0).reshape(2, 3)}, {f"key {n}": "ä" * n for n in range(12)}
    write_safetensors(tmp_path / "one", tensors, about)
    write_safetensors(tmp_path / "two", tensors, dict(reversed(about.items())))
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    with safe_open(tmp_path / "one", "np") as file:
        assert file.metadata() == about
        np.testing.assert_array_equal(file.get_tensor("weight"), tensors["weight"])


def _file(folder: Path, header: object, data: bytes) -> Path:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    (folder / "bad.safetensors").write_bytes(struct.pack("<Q", len(text)) + text + data)
    return folder / "bad.safetensors"


def _entry(dtype: str = "F32", shape: object = (2,), offsets: object = (0, 8)) -> dict[str, object]:
    return {"t": {"dtype": dtype, "shape": shape, "data_offsets": offsets}}


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (_entry(shape=[3]), "truncated, damaged or no safetensors file"),
        (_entry(dtype="F8_E4M3", shape=[8]), "t holds F8_E4M3, expected one of F64"),
        (b"{not json", "truncated, damaged or no safetensors file"),
        (_entry(shape=(0, 2**62, 2**62), offsets=(0, 0)), r"t: no array has shape \[0, 4611686018427387904"),
    ],
)
def test_broken_files_are_refused(tmp_path, header, message):
    """Oracle: the break itself; what else may be broken is the package's affair."""
    with pytest.raises(FileError, match=rf"bad\.safetensors: {message}"):
        read_safetensors(_file(tmp_path, header, b"" if "no array" in message else b"\0" * 8))
    with pytest.raises(FileError, match=r"none\.safetensors: cannot be read"):
        read_safetensors(tmp_path / "none.safetensors")


def test_bfloat16_tensors_are_widened(tmp_path):
    """Oracle: closed form; the file says BF16, the array is float32."""
    arrays, codes, _ = read_safetensors(_file(tmp_path, _entry("BF16", (4,)), struct.pack("<4H", 0x3F80, 0xC040, 0, 0)))
    assert codes == {"t": "BF16"}
    np.testing.assert_array_equal(arrays["t"], np.array([1, -3, 0, 0], np.float32))


def test_what_cannot_be_written_is_refused(tmp_path):
    """Oracle: a folder that is not there, and one of the file's name."""
    with pytest.raises(OutputError, match="cannot be written"):
        write_safetensors(tmp_path / "missing" / "w.safetensors", TENSORS)
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError, match="folder: cannot be written"):
        write_safetensors(tmp_path / "folder", TENSORS)
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]
