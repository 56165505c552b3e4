"""Damaged, cut and strange depth files: a FileError with one line, or the whole depth; never half."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from dlama.errors import FileError
from dlama.files.rasters.depth import read_depth, write_depth_exr, write_depth_png, write_pfm


def exr(path: Path, kind: int | None = None, **channels: np.ndarray) -> Path:
    """An EXR written by the OpenEXR library alone."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION if kind is None else kind, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name.replace("__", "."): values for name, values in channels.items()}).write(str(path))
    return path


def tiff(path: Path, values: np.ndarray) -> Path:
    Image.fromarray(values).save(path)
    return path


@pytest.mark.parametrize("name", ["d.png", "d.exr", "piz.exr", "raw.exr", "d.pfm", "d.npy", "d.npz", "d.tif", "f.tif"])
def test_truncated_depth_raises_or_is_whole(tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    """Oracle: the whole file; and nothing but our own words reaches the terminal."""
    path, depth = tmp_path / name, np.random.default_rng(0).uniform(1, 9, (70, 50)).astype(np.float32)
    writers = {
        "d.png": lambda: write_depth_png(path, depth),
        "d.exr": lambda: write_depth_exr(path, depth),
        "piz.exr": lambda: exr(path, OpenEXR.PIZ_COMPRESSION, Z=depth),
        "raw.exr": lambda: exr(path, OpenEXR.NO_COMPRESSION, R=depth, G=depth, B=depth),
        "d.pfm": lambda: write_pfm(path, depth),
        "d.npy": lambda: np.save(path, depth),
        "d.npz": lambda: np.savez_compressed(path, depth=depth),
        "d.tif": lambda: tiff(path, (depth * 1000).astype(np.uint16)),
        "f.tif": lambda: tiff(path, depth),
    }
    writers[name]()
    data, whole = path.read_bytes(), read_depth(path)
    for kept in [*np.linspace(1, len(data) - 40, 25).astype(int), *range(len(data) - 20, len(data), 4)]:
        path.write_bytes(data[:kept])
        try:
            assert np.array_equal(read_depth(path), whole), f"{name} cut to {kept} of {len(data)} bytes"
        except FileError as error:
            assert str(path) in str(error) and "\n" not in str(error)
            continue
        assert kept > len(data) - 40
    if not name.endswith(".tif"):  # libtiff's own remarks
        assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"])
def test_every_exr_compression_is_seen_as_whole(tmp_path: Path, name: str) -> None:
    """The check for cut files knows how many lines each compression packs together (oracle: OpenEXR's own files)."""
    depth = np.full((301, 5), 2, np.float32)
    path = exr(tmp_path / "d.exr", getattr(OpenEXR, f"{name}_COMPRESSION"), Z=depth)
    assert read_depth(path).shape == depth.shape
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(FileError, match="truncated"):
        read_depth(path)


def test_exr_with_another_window_is_refused(tmp_path: Path) -> None:
    corner = (np.array([0, 0], np.int32), np.array([7, 7], np.int32))
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "displayWindow": corner}
    OpenEXR.File(header, {"Z": np.ones((4, 4), np.float32)}).write(str(tmp_path / "d.exr"))
    with pytest.raises(FileError, match="cropped"):
        read_depth(tmp_path / "d.exr")
