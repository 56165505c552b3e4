"""Diagnosis of a picture with depth from files (oracle: how the files were spoilt)."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import dlama
from dlama.perception.diagnosis.finding import Finding
from dlama.worlds.layouts.random_scene import build

SIZE = 192


@cache
def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colour, depth in metres and the object's mask of a street, higher than wide is cut off its sides."""
    made = build(3, "street", (), shadows=True, antialias=True)
    seen = made.raycast(made.camera(0, SIZE, 75))
    return seen.color, seen.depth, seen.group == made.object_index


def write(folder: Path, turn: object = None, **depth: np.ndarray) -> tuple[Path, Path]:
    """image.png and depth.png (mm) of the scene, or the depth that is given."""
    color, metres, _ = scene()
    values = depth.get("depth", np.where(np.isfinite(metres), np.round(metres * 1000), 65535).astype(np.uint16))
    Image.fromarray(color).save(folder / "image.png")
    Image.fromarray(values).save(folder / "depth.png")
    return folder / "image.png", folder / "depth.png"


def checks(found: tuple[Finding, ...]) -> list[str]:
    return [finding.check for finding in found]


def test_good_files_give_one_line(tmp_path: Path) -> None:
    found = dlama.diagnose(*write(tmp_path), fov=75)
    assert checks(found) == ["understood"]
    assert found[0].line.startswith("image.png, depth.png: nothing wrong: 192x192, 75 degrees wide, depth 1.")


def test_units_and_radians_are_told_together(tmp_path: Path) -> None:
    metres = scene()[1]
    five = np.where(metres < 13, np.round(metres * 5000), 65535).astype(np.uint16)
    found = dlama.diagnose(*write(tmp_path, depth=five), fov=np.radians(75))
    assert checks(found) == ["fov-radians", "depth-scale", "understood"]
    assert found[0].mend == "give `fov=75`" and found[1].mend == "give `depth_scale=5000`"
    assert checks(dlama.diagnose(*write(tmp_path, depth=five), fov=75, depth_scale=5000)) == ["understood"]


def test_eight_bit_depth(tmp_path: Path) -> None:
    metres = scene()[1]
    found = dlama.diagnose(*write(tmp_path, depth=np.clip(metres * 10, 0, 255).astype(np.uint8)), fov=75)
    assert checks(found)[0] == "eight-bit-depth"


def test_depth_of_half_the_size(tmp_path: Path) -> None:
    metres = scene()[1]
    half = np.where(np.isfinite(metres), np.round(metres * 1000), 65535).astype(np.uint16)[::2, ::2]
    image, depth = write(tmp_path, depth=half)
    assert checks(dlama.diagnose(image, depth, fov=75)) == ["size", "understood"]
    assert checks(dlama.diagnose(image, depth, fov=75, resize_depth="nearest")) == ["understood"]


def test_other_proportions(tmp_path: Path) -> None:
    image, depth = write(tmp_path, depth=np.full((96, 192), 2000, np.uint16))
    assert checks(dlama.diagnose(image, depth, fov=75)) == ["size"]


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_a_tag_on_pixels_that_fit_as_they_are_stored(tmp_path: Path, orientation: int) -> None:
    image, depth = write(tmp_path)
    tags = Image.Exif()
    tags[0x0112] = orientation
    Image.open(image).save(image, exif=tags)
    found = dlama.diagnose(image, depth, fov=75)
    assert checks(found) == ["orientation", "understood"] and "exiftool -Orientation= image.png" in found[0].mend


def test_a_tag_that_is_right_is_fine(tmp_path: Path) -> None:
    """Oracle: EXIF 6 is shown turned by 90 degrees clockwise; the pixels are stored turned back."""
    image, depth = write(tmp_path)
    tags = Image.Exif()
    tags[0x0112] = 6
    Image.fromarray(np.ascontiguousarray(np.rot90(scene()[0], 1))).save(image, exif=tags)
    assert checks(dlama.diagnose(image, depth, fov=75)) == ["understood"]


def test_masks(tmp_path: Path) -> None:
    image, depth = write(tmp_path)
    mask = tmp_path / "mask.png"
    Image.fromarray((scene()[2] * 255).astype(np.uint8)).save(mask)
    assert checks(dlama.diagnose(image, depth, mask, fov=75)) == ["understood"]
    assert checks(dlama.diagnose(image, depth, mask, fov=75, mask_polarity="known")) == ["inverted-mask", "understood"]
    Image.fromarray((scene()[2] * 255).astype(np.uint8)[::2]).save(mask)
    assert checks(dlama.diagnose(image, depth, mask, fov=75)) == ["size", "understood"]
    Image.fromarray(np.full((SIZE, SIZE), 128, np.uint8)).save(mask)
    assert checks(dlama.diagnose(image, depth, mask, fov=75)) == ["reading", "understood"]


def test_files_that_cannot_be_read_are_findings(tmp_path: Path) -> None:
    image, depth = write(tmp_path)
    (tmp_path / "bad.png").write_bytes(b"nothing")
    for paths in ((image, tmp_path / "none.png"), (tmp_path / "bad.png", depth)):
        found = dlama.diagnose(*paths, fov=75)
        assert checks(found) == ["reading"] and found[0].confidence == 1
    assert checks(dlama.diagnose(image, depth, camera=tmp_path / "no.json")) == ["reading", "understood"]
    assert checks(dlama.diagnose(image, depth)) == ["camera", "understood"]
    assert checks(dlama.diagnose(image)) == ["photo-depth", "understood"]


def test_negative_depth(tmp_path: Path) -> None:
    image, _ = write(tmp_path)
    np.save(tmp_path / "depth.npy", -scene()[1])
    assert "negative-depth" in checks(dlama.diagnose(image, tmp_path / "depth.npy", fov=75))
