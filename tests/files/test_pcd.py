"""Organised point clouds of PCL as depth (oracle: the numbers that were written, by the format's own description)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dlama.errors import FileError
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.pcd_files import decompress

DEPTH = np.random.default_rng(5).uniform(0.5, 9, (7, 11)).astype(np.float32)
FIELDS = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4"), ("normal", "<f4", 3)]


def cloud(kind: str, height: int = 7) -> bytes:
    """The file; NaN is missing."""
    points = np.zeros(DEPTH.size, FIELDS)
    points["x"], points["y"], points["z"], points["rgb"] = 1, -2, DEPTH.ravel(), 0x102030
    points["z"][3] = np.nan
    head = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb normal\nSIZE 4 4 4 4 4\nTYPE F F F U F\n"
    head += f"COUNT 1 1 1 1 3\nWIDTH {DEPTH.size // height}\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {DEPTH.size}\n"
    if kind == "ascii":
        lines = (" ".join(map(repr, map(float, np.hstack([*map(np.atleast_1d, point)])))) for point in points.tolist())
        body = "\n".join(lines).encode()
    elif kind == "binary":
        body = points.tobytes()
    else:
        raw = b"".join(points[name].tobytes() for name, *_ in FIELDS)
        parts = [raw[at : at + 32] for at in range(0, len(raw), 32)]
        packed = b"".join(bytes([len(part) - 1]) + part for part in parts)
        body = np.array([len(packed), len(raw)], "<u4").tobytes() + packed
    return head.encode() + f"DATA {kind}\n".encode() + body


@pytest.mark.parametrize("kind", ["ascii", "binary", "binary_compressed"])
def test_an_organised_cloud_is_depth(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "cloud.pcd"
    path.write_bytes(cloud(kind))
    expected = DEPTH.copy()
    expected[0, 3] = 0
    np.testing.assert_allclose(read_depth(path), expected, rtol=1e-6)


def test_runs_of_bytes_that_repeat() -> None:
    """Vectors by hand: three letters and what lies three, or one, back, also over more than there is yet."""
    assert decompress(b"\x02abc\x80\x02", 9) == b"abcabcabc"
    assert decompress(b"\x00a\xe0\x05\x00", 15) == b"a" * 15
    assert decompress(b"\x03abcd\x20\x03\x00e", 8) == b"abcdabce"
    with pytest.raises(ValueError, match="before its beginning"):
        decompress(b"\x00a\x20\x07", 4)


@pytest.mark.parametrize(
    ("data", "reported"),
    [
        (cloud("binary", 1), "is a cloud of 77 points in no order"),
        (cloud("binary")[:-9], "is damaged, truncated or no PCD"),
        (cloud("ascii")[:-400], "is damaged, truncated or no PCD"),
        (cloud("binary_compressed")[:-99], "is damaged, truncated or no PCD"),
        (cloud("binary").replace(b" z ", b" w "), "is damaged, truncated or no PCD"),
        (cloud("binary").replace(b"WIDTH 11", b"WIDTH 99999999"), "at most 67 million are read"),
        (b"ply\n", "is no PCD point cloud"),
    ],
)
def test_clouds_that_are_no_depth(data: bytes, reported: str, tmp_path: Path) -> None:
    """Law: one line that names the file."""
    (tmp_path / "cloud.pcd").write_bytes(data)
    with pytest.raises(FileError, match=rf"cloud\.pcd: .*{reported}"):
        read_depth(tmp_path / "cloud.pcd")
