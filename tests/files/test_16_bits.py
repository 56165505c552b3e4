"""A plate of 16 bits a channel: a warning names it, meta.json has it, and what was measured comes back as it was."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import cv2
import imageio.v3 as imageio
import numpy as np
import pytest
import tifffile

from box_frame import CAMERA, WORLD, pixels, small_frame
from dlama.apps.cli import main
from dlama.completion.stereo.stereo import stereo
from dlama.completion.verbs import remove, view
from dlama.errors import FileError
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.images import has_16_bits
from dlama.files.rasters.masks import read_mask
from dlama.files.rasters.pictures import read_color, read_color_of_camera
from dlama.files.results.completion import write
from dlama.files.rgbd import read_rgbd
from dlama.geometry.camera import StereoRig
from dlama.geometry.codes import Origin
from dlama.geometry.rgbd import RGBD
from worlds import moved

WORDS = r"16 bits a channel; colours are worked on, filled and written in 8"


def deepen(color: np.ndarray) -> np.ndarray:
    """8 bits in the high bytes of 16, noise in the low ones."""
    return color.astype(np.uint16) << 8 | np.random.default_rng(3).integers(0, 256, color.shape).astype(np.uint16)


def plate_of(folder: Path, name: str = "plate.tif") -> np.ndarray:
    """uint16 H x W x 3 in a file next to those of `small_frame`: its picture in the high bytes, noise in the low ones."""
    plate = deepen(pixels(small_frame(folder) / "image.png"))
    if name.endswith(".tif"):
        tifffile.imwrite(folder / name, plate, photometric="rgb", compression="zlib", predictor=True)
    else:
        cv2.imwrite(str(folder / name), plate[..., ::-1])
    return plate


@pytest.mark.parametrize("name", ["plate.tif", "plate.png"])
def test_a_removal_gives_measured_pixels_of_a_plate_back(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracles: the plate; Pillow, which reads the high bytes; the result of the same picture in 8 bits."""
    plate = plate_of(tmp_path, name)
    assert has_16_bits(tmp_path / name) and not has_16_bits(tmp_path / "image.png")
    for picture in (name, "image.png"):
        words = [tmp_path / picture, tmp_path / "depth.png", tmp_path / "mask.png", "--fov", "60", "--filler", "telea"]
        main(["remove", *map(str, words), "-o", str(tmp_path / picture.replace(".", "-"))])
    warned = [line for line in capsys.readouterr().err.splitlines() if "16 bits" in line]
    assert warned == [line for line in warned if line.startswith(f"warning: {tmp_path / name}: has 16 bits")] != []
    out, of_8_bits = tmp_path / name.replace(".", "-"), tmp_path / "image-png"
    found = cv2.imread(str(out / "image.png"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    measured = pixels(out / "origin.png") == Origin.MEASURED.value
    assert found.dtype == np.uint16 and 0.5 < measured.mean() < 1
    assert np.array_equal(found[measured], plate[measured])
    high_bytes, of_8 = imageio.imread(out / "image.png"), imageio.imread(of_8_bits / "image.png")
    assert np.array_equal(found >> 8, high_bytes) and np.array_equal(high_bytes, of_8)
    assert len(np.unique((found - (found >> 8) * 257)[~measured])) == 1, "what was filled has 8 bits"
    meta, other = (json.loads((folder / "meta.json").read_text()) for folder in (out, of_8_bits))
    assert (meta["inputs"]["image"]["bits"], meta["image_png_bits"]) == (16, 16)
    assert ("bits" in other["inputs"]["image"], other["image_png_bits"]) == (False, 8)
    assert "bits" not in meta["inputs"]["depth"]


def test_both_plates_of_a_pair_are_given_back(tmp_path: Path) -> None:
    """Oracle: the plates, wherever the eye itself measured; what was filled or transferred has their size of numbers too."""
    rig = StereoRig(CAMERA, moved(CAMERA, shift=(0.4, 0, 0)))
    plates, files = [], {}
    for name, camera in (("left", rig.left), ("right", rig.right)):
        plates.append(deepen(WORLD.rgbd(camera).color))
        files[name] = tmp_path / f"{name}.tif"
        tifffile.imwrite(files[name], plates[-1], photometric="rgb")
    pictures = [(plate >> 8).astype(np.uint8) for plate in plates]
    disparity = (CAMERA.fx * rig.baseline_m / WORLD.rgbd(rig.left).depth).astype(np.float32)
    mask = WORLD.trace(rig.left)[1] == 1
    done = stereo(*pictures, rig, disparity=disparity, mask=mask, filler="telea")
    out = write(done, tmp_path / "out", only=["image"], inputs=files)
    assert json.loads((out / "meta.json").read_text())["image_png_bits"] == {"": 16, "right/": 16}
    for plate, view_of_eye, place in zip(plates, done.views, (out, out / "right")):
        found = cv2.imread(str(place / "image.png"), cv2.IMREAD_UNCHANGED)[..., ::-1]
        measured = view_of_eye.origin == Origin.MEASURED.value
        assert np.array_equal(found >> 8, view_of_eye.color) and 0.5 < measured.mean() < 1
        assert np.array_equal(found[measured], plate[measured])


def test_another_view_and_another_picture_have_8_bits(tmp_path: Path) -> None:
    """Oracle: the bits in the header of the file, as Pillow reads them."""
    plate_of(tmp_path)
    with pytest.warns(UserWarning, match=rf"plate\.tif: has {WORDS}"):
        rgbd = read_rgbd(tmp_path / "plate.tif", tmp_path / "depth.png", fov=60)
    moved = write(view(rgbd, yaw=5, filler="telea"), tmp_path / "moved", inputs={"image": tmp_path / "plate.tif"})
    edited = RGBD(255 - rgbd.color, rgbd.depth, rgbd.camera)
    mask = read_mask(tmp_path / "mask.png")
    done = remove(edited, mask, filler="telea")
    edited_out = write(done, tmp_path / "edited", inputs={"image": tmp_path / "plate.tif"}, only=["image"])
    for out in (moved, edited_out):
        assert not has_16_bits(out / "image.png")
        meta = json.loads((out / "meta.json").read_text())
        assert (meta["inputs"]["image"]["bits"], meta["image_png_bits"]) == (16, 8)


@pytest.mark.parametrize("compression", [None, "zlib"])
def test_planes_of_16_bits_are_refused(tmp_path: Path, compression: str | None) -> None:
    """OpenCV mixes their rows: such a plate came out as noise. Oracle for 8 bits, which Pillow reads: what was written."""
    plate = plate_of(tmp_path)
    planes: dict[str, Any] = {"photometric": "rgb", "planarconfig": "separate", "compression": compression}
    tifffile.imwrite(tmp_path / "planar.tif", np.moveaxis(plate, 2, 0), **planes)
    with pytest.raises(FileError, match=r"planar\.tif: holds its channels one after the other \(planar\) in 16 bits"):
        read_color(tmp_path / "planar.tif")
    tifffile.imwrite(tmp_path / "planar8.tif", np.moveaxis(plate >> 8, 2, 0).astype(np.uint8), **planes)
    assert np.array_equal(read_color(tmp_path / "planar8.tif"), plate >> 8)


@pytest.mark.parametrize(
    "kind, shape, words",
    [
        (np.float32, (4, 5, 3), r"whose channels \(3\) are float numbers of 32 bits"),
        (np.float16, (4, 5, 3), r"whose channels \(3\) are float numbers of 16 bits"),
        (np.float64, (4, 5), r"whose channels \(1\) are float numbers of 64 bits"),
    ],
)
def test_a_tiff_of_other_numbers_is_described(tmp_path: Path, kind: type, shape: tuple[int, ...], words: str) -> None:
    """A scene-linear plate, or depth in doubles, was called no picture."""
    tifffile.imwrite(tmp_path / "a.tif", np.ones(shape, kind), photometric="rgb" if len(shape) == 3 else "minisblack")
    for read in (read_color, read_depth):
        with pytest.raises(FileError, match=rf"a\.tif: .*{words}.* 32-bit floats are read"):
            read(tmp_path / "a.tif")


def test_frames_of_a_folder_are_warned_of_by_the_folder(tmp_path: Path) -> None:
    """So that one line stands for all of them; results of sequences have 8 bits throughout."""
    plate = plate_of(tmp_path)
    with pytest.warns(UserWarning, match=rf"^{re.escape(str(tmp_path))}: its pictures have {WORDS}$"):
        assert np.array_equal(read_color_of_camera(tmp_path / "plate.tif"), plate >> 8)
