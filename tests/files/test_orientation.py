"""Pictures, depth and masks are turned alike, as viewers show them.

Oracle: Pillow's own exif_transpose.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageOps

import dlama
from dlama.errors import CameraError, FileError, ShapeError
from dlama.files.rasters.images import orientation_of, picture_hw, read_stored
from dlama.files.rasters.masks import read_mask
from dlama.files.rasters.pictures import read_color, read_color_of_camera
from dlama.files.rgbd import read_rgbd
from dlama.jobs.inputs import JobInputs

RNG = np.random.default_rng(0)
PICTURES = {
    "grey": RNG.integers(0, 256, (4, 6), dtype=np.uint8),
    "colour": RNG.integers(0, 256, (4, 6, 3), dtype=np.uint8),
    "depth": RNG.integers(0, 65536, (4, 6), dtype=np.uint16),
    "deep colour": RNG.integers(0, 65536, (4, 6, 3), dtype=np.uint16),
    "float depth": RNG.random((4, 6), np.float32),
}


def shown(values: np.ndarray, orientation: int) -> np.ndarray:
    """As Pillow shows it, channel by channel."""
    planes = []
    for plane in np.atleast_3d(values).transpose(2, 0, 1):
        picture = Image.fromarray(np.ascontiguousarray(plane))
        picture.getexif()[0x0112] = orientation
        planes.append(np.asarray(ImageOps.exif_transpose(picture)))
    return np.stack(planes, 2).reshape(*planes[0].shape, *values.shape[2:])


def write(path: Path, values: np.ndarray, orientation: int) -> Path:
    """A TIFF or PNG whose tag says that it is turned."""
    if path.suffix == ".tif":
        kind = "rgb" if values.ndim == 3 else "minisblack"
        tifffile.imwrite(path, values, extratags=[(274, "H", 1, orientation, True)], photometric=kind)
        return path
    data = cv2.imencode(".png", values[..., ::-1] if values.ndim == 3 else values)[1].tobytes()
    exif = Image.Exif()
    exif[0x0112] = orientation
    chunk = b"eXIf" + exif.tobytes().removeprefix(b"Exif\0\0")
    head = 33  # signature and IHDR
    size, checksum = struct.pack(">I", len(chunk) - 4), struct.pack(">I", zlib.crc32(chunk))
    path.write_bytes(data[:head] + size + chunk + checksum + data[head:])
    return path


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize(
    ("kind", "suffix"),
    [*((kind, ".tif") for kind in PICTURES), ("colour", ".png"), ("depth", ".png"), ("deep colour", ".png")],
)
def test_every_kind_of_picture_is_read_as_shown(tmp_path: Path, kind: str, suffix: str, orientation: int) -> None:
    path = write(tmp_path / f"turned{suffix}", PICTURES[kind], orientation)
    expected = shown(PICTURES[kind], orientation)
    assert np.array_equal(read_stored(path).values, expected)
    assert picture_hw(path) == expected.shape[:2]
    assert orientation_of(path) == orientation


@pytest.mark.parametrize("orientation", [1, 6])
def test_a_big_tiff_is_turned_too(tmp_path: Path, orientation: int) -> None:
    """BigTIFF, whose offsets have 64 bits; with the other byte order, which Pillow does not read, it is refused."""
    values, tags = PICTURES["depth"], [(274, "H", 1, orientation, True)]
    tifffile.imwrite(tmp_path / "big.tif", values, bigtiff=True, byteorder="<", extratags=tags)
    assert (tmp_path / "big.tif").read_bytes()[:4] == b"II+\0"
    expected = shown(values, orientation)
    assert np.array_equal(read_stored(tmp_path / "big.tif").values, expected)
    assert picture_hw(tmp_path / "big.tif") == expected.shape
    assert orientation_of(tmp_path / "big.tif") == orientation
    tifffile.imwrite(tmp_path / "other.tif", values, bigtiff=True, byteorder=">", extratags=tags)
    with pytest.raises(FileError, match=r"other\.tif: is no readable"):
        read_stored(tmp_path / "other.tif")


def rgbd_files(folder: Path, orientations: tuple[int, int, int]) -> tuple[Path, Path, Path]:
    """Picture, depth and mask of 6 x 4 px, each with its own tag."""
    mask = np.zeros((4, 6), np.uint8)
    mask[1, 2:5] = 255
    depth = RNG.integers(1000, 3000, (4, 6), dtype=np.uint16)
    arrays = PICTURES["colour"], depth, mask
    names = "image.png", "depth.tif", "mask.png"
    return tuple(write(folder / name, array, o) for name, array, o in zip(names, arrays, orientations))  # type: ignore[return-value]


def test_picture_depth_and_mask_turn_alike(tmp_path: Path) -> None:
    image, depth, mask = rgbd_files(tmp_path, (6, 6, 6))
    rgbd = read_rgbd(image, depth, fov=60)
    assert rgbd.depth.shape == (6, 4) == read_mask(mask).shape
    assert np.array_equal(read_mask(mask), shown(np.asarray(Image.open(mask)) > 127, 6))
    assert np.array_equal(rgbd.color, shown(PICTURES["colour"], 6))


def test_a_quarter_turn_of_one_of_them_is_named(tmp_path: Path) -> None:
    """The sizes do not fit: the message says which file carries the tag."""
    for orientations in ((6, 1, 1), (1, 6, 1)):
        image, depth, _ = rgbd_files(tmp_path, orientations)
        with pytest.raises(ShapeError, match=r"EXIF orientation 6.*has none"):
            read_rgbd(image, depth, fov=60)
    image, _, mask = rgbd_files(tmp_path, (1, 1, 6))
    with pytest.raises(ShapeError, match=r"mask.png is shown .* EXIF orientation 6, .*has none.*4x6 and .*6x4"):
        JobInputs().read_mask_file({"mask": mask, "image": image}, "mask", "image")


def test_a_half_turn_of_one_of_them_is_warned_of(tmp_path: Path) -> None:
    """The sizes fit either way."""
    for orientations in ((3, 1, 1), (1, 3, 1)):
        image, depth, _ = rgbd_files(tmp_path, orientations)
        with pytest.warns(UserWarning, match=r"EXIF orientation 3.*clear the tag"):
            read_rgbd(image, depth, fov=60)


def test_a_quarter_turn_that_fits_is_not_in_doubt(tmp_path: Path) -> None:
    """Closed form: a phone's photo, 6 x 4 stored and 4 x 6 shown, with depth and mask of 4 x 6: in no other way do they fit."""
    image, *_ = rgbd_files(tmp_path, (6, 1, 1))
    depth = write(tmp_path / "shown.tif", np.full((6, 4), 2000, np.uint16), 1)
    mask = write(tmp_path / "shown.png", np.eye(6, 4).astype(np.uint8) * 255, 1)
    read_rgbd(image, depth, fov=60)
    JobInputs().read_mask_file({"mask": mask, "image": image}, "mask", "image")
    assert not any(found.check == "orientation" for found in dlama.diagnose(image, depth, mask, fov=60))


@pytest.mark.parametrize("turned", [0, 2])
def test_a_mask_turned_otherwise_than_its_picture_is_warned_of(tmp_path: Path, turned: int) -> None:
    """Law: as of depth, a tag that only one of the two has is named, by the verbs and by the doctor."""
    image, depth, mask = rgbd_files(tmp_path, tuple(3 if place == turned else 1 for place in range(3)))  # type: ignore[arg-type]
    name = (image, depth, mask)[turned].name
    with pytest.warns(UserWarning, match=rf"{name} is shown turned by its EXIF orientation 3.*clear the tag"):
        JobInputs().read_mask_file({"mask": mask, "image": image}, "mask", "image")
    JobInputs().read_mask_file({"mask": mask, "image": mask}, "mask", "image")
    if turned == 2:
        findings = dlama.diagnose(image, depth, mask, fov=60)
        assert any(name in found.what for found in findings if found.check == "orientation")


def test_a_camera_of_the_stored_size_is_refused(tmp_path: Path) -> None:
    image, depth, _ = rgbd_files(tmp_path, (6, 6, 6))
    camera = tmp_path / "camera.json"
    camera.write_text('{"width": 6, "height": 4, "fx": 5, "fy": 5, "cx": 3, "cy": 2}')
    with pytest.raises(CameraError, match=r"6x4 and the picture 4x6.*as viewers show it"):
        read_rgbd(image, depth, camera=camera)


def test_pictures_of_posed_cameras_must_not_be_turned(tmp_path: Path) -> None:
    """A pose file speaks of the pixels as stored."""
    path = write(tmp_path / "frame.png", PICTURES["colour"], 3)
    assert np.array_equal(read_color(path), shown(PICTURES["colour"], 3))
    with pytest.raises(FileError, match=r"orientation 3.*exiftool"):
        read_color_of_camera(path)
