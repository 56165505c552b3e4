"""HEIC photos (oracle: the pixels that pillow-heif was given to write without loss, EXIF 2.32)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pillow_heif
import pytest
from PIL import Image

from dlama.errors import CameraError, FileError, MissingExtraError
from dlama.files.rasters.images import orientation_of, picture_hw, read_stored
from dlama.files.rasters.pictures import read_color, read_color_of_camera

SHOWN = np.random.default_rng(0).integers(0, 256, (64, 96, 3), np.uint8)


def heic(path: Path, values: np.ndarray, orientation: int = 1, focal_35mm: int | None = None) -> Path:
    """A file as phones write it: the stored pixels, how they are turned, and the lens."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    if focal_35mm:
        exif.get_ifd(0x8769)[0xA405] = focal_35mm
    picture = pillow_heif.from_pillow(Image.fromarray(values))
    picture.save(path, quality=-1, chroma=444, matrix_coefficients=0, exif=exif.tobytes())
    return path


def test_pixels_and_lens_are_read(tmp_path: Path) -> None:
    stored = read_stored(heic(tmp_path / "photo.heic", SHOWN, focal_35mm=26))
    np.testing.assert_array_equal(stored.values, SHOWN)
    assert (stored.orientation, stored.focal_35mm) == (1, 26)


def test_a_turned_photo_is_shown_upright(tmp_path: Path) -> None:
    """Orientation 6: stored row 0 is the right side of what is shown. Its size is that of what is shown; with a camera of the
    stored pixels it is refused, as a JPEG is."""
    path = heic(tmp_path / "photo.HEIC", np.ascontiguousarray(np.rot90(SHOWN)), orientation=6)
    np.testing.assert_array_equal(read_color(path), SHOWN)
    assert picture_hw(path) == (64, 96) and orientation_of(path) == 6
    with pytest.raises((FileError, CameraError), match="turned"):
        read_color_of_camera(path)


def test_without_the_package_it_says_which(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = heic(tmp_path / "photo.heic", SHOWN)
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    for read in (read_stored, picture_hw):
        with pytest.raises(MissingExtraError, match=r"photo.heic: a HEIC picture needs .*pip install 'dlama\[heic\]'"):
            read(path)
