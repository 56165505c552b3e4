"""What a small file claims to hold is refused before memory is taken for it (oracle: the limit, and a child's memory)."""

from __future__ import annotations

import io
import struct
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dlama.errors import FileError
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.float_files import read_array, read_pfm
from dlama.files.rasters.images import picture_hw
from dlama.files.rasters.pictures import read_color
from dlama.files.scenes.clouds import read_ply
from dlama.files.scenes.scene_npz import read_npz

MOST = 64e6
"""Bytes that a refusal may take."""


def npy(shape: tuple[int, ...], dtype: str = "<f4", numbers: bytes = b"\0" * 64) -> bytes:
    """An NPY whose header says `shape`."""
    stream, says = io.BytesIO(), {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, says)
    return stream.getvalue() + numbers


def npz(**parts: bytes) -> bytes:
    """An NPZ of parts, compressed."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in parts.items():
            archive.writestr(f"{name}.npy", data)
    return stream.getvalue()


def png(width: int, height: int) -> bytes:
    """A grey PNG whose header says so."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    pixels = chunk(b"IDAT", zlib.compress(b"\0" * 9999))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + pixels + chunk(b"IEND", b"")


BIG = 40_000
MUCH = b"\0" * 80_000_000
"""More than MOST, in a few KB of a compressed file."""
FILES: dict[str, tuple[Callable[[], bytes], Callable[[Path], object]]] = {
    "claims.npy": (lambda: npy((BIG, BIG)), lambda path: read_array(path, "depth")),
    "negative.npy": (lambda: npy((-1, 5)), lambda path: read_array(path, "depth")),
    "objects.npy": (lambda: npy((4, 4), "|O"), lambda path: read_array(path, "depth")),
    "claims.npz": (lambda: npz(depth=npy((BIG, BIG))), lambda path: read_array(path, "depth")),
    "bomb.npz": (lambda: npz(depth=npy((20_000, 16_000), numbers=MUCH)), lambda path: read_array(path, "depth")),
    "scene.npz": (lambda: npz(rgb=npy((9999, 9999, 3), "|u1", MUCH)), read_npz),
    "claims.pfm": (lambda: b"Pf\n40000 40000\n-1\n" + bytes(64), read_pfm),
    "digits.pfm": (lambda: b"Pf\n" + b"9" * 5000 + b" 4\n-1\n" + bytes(64), read_pfm),
    "scale.pfm": (lambda: b"Pf\n2 2\n1.2.3\n" + bytes(16), read_pfm),
    "claims.png": (lambda: png(BIG, BIG), read_color),
    "header.png": (lambda: png(BIG, BIG), picture_hw),
    "depth.png": (lambda: png(BIG, BIG), read_depth),
    "claims.ply": (
        lambda: b"ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nproperty float y\nproperty float z\n"
        b"end_header\n0 0 0\n",
        read_ply,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_claims_are_refused_before_memory_is_taken(tmp_path: Path, name: str) -> None:
    made, read = FILES[name]
    path = tmp_path / name
    path.write_bytes(made())
    tracemalloc.start()
    try:
        with pytest.raises(FileError, match=name):
            read(path)
        assert tracemalloc.get_traced_memory()[1] < MOST
    finally:
        tracemalloc.stop()


def test_arrays_come_back_in_every_layout(tmp_path: Path) -> None:
    """Round trip through numpy's own writer: by rows and by columns, big-endian, every version of the header."""
    depth = np.arange(12, dtype=">f4").reshape(3, 4) + 1
    for array in (depth, np.asfortranarray(depth), depth.astype("<u2"), depth[None]):
        np.save(tmp_path / "a.npy", array)
        np.savez_compressed(tmp_path / "a.npz", other=np.zeros(3), depth=array)
        for name in ("a.npy", "a.npz"):
            assert np.array_equal(read_array(tmp_path / name, "depth"), array.reshape(3, 4))


@pytest.mark.parametrize("name", ["nul\0.png", "n" * 300 + ".png", "\udcff\udcfe.png"])
def test_names_that_no_file_has(tmp_path: Path, name: str) -> None:
    """One line that can be printed anywhere, with what is wrong."""
    with pytest.raises(FileError) as refusal:
        read_color(tmp_path / name)
    assert str(refusal.value).isprintable()
    str(refusal.value).encode("utf-8")


def test_a_sound_picture_that_is_too_large_is_not_called_damaged(tmp_path: Path) -> None:
    """16320 x 12240, which phones take, is beyond what Pillow opens, too (oracle: the message of 9000 x 8000, which it opens)."""
    reasons = []
    for size in ((9000, 8000), (16320, 12240)):
        (tmp_path / "big.png").write_bytes(png(*size))
        with pytest.raises(FileError, match=r"big\.png: says it holds") as refused:
            picture_hw(tmp_path / "big.png")
        reasons.append(str(refused.value).partition(" pixels; ")[2])
    assert reasons == ["at most 67 million are read, scale it down"] * 2
