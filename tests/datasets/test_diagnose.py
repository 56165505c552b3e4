"""`dlama.diagnose` of a picture with depth from files (oracle: how the files were spoilt)."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import dlama
from dlama.perception.diagnosis.finding import Finding
from dlama.worlds.layouts.random_scene import build

SIZE = 128


@cache
def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colour, depth in metres and the object's mask of a street."""
    made = build(3, "street", ())
    seen = made.raycast(made.camera(0, SIZE, 75))
    return seen.color, seen.depth, seen.group == made.object_index


def codes(units: float = 1000) -> np.ndarray:
    """16-bit depth of the scene, so many units a metre."""
    metres = scene()[1]
    return np.where(metres * units < 65535, np.round(metres * units), 65535).astype(np.uint16)


def write(folder: Path, depth: np.ndarray | None = None) -> tuple[Path, Path]:
    """image.png and depth.png of the scene, or the depth that is given."""
    Image.fromarray(scene()[0]).save(folder / "image.png")
    Image.fromarray(codes() if depth is None else depth).save(folder / "depth.png")
    return folder / "image.png", folder / "depth.png"


def checks(found: tuple[Finding, ...]) -> list[str]:
    return [finding.check for finding in found]


def test_good_files_give_one_line(tmp_path: Path) -> None:
    """Of a unit that is not millimetres the option is named, with which they are good, too."""
    unit, _ = dlama.diagnose(*write(tmp_path, codes(5000)), fov=75)
    assert (unit.check, unit.mend) == ("depth-scale", "give `depth_scale=5000`")
    files = tmp_path / "image.png", tmp_path / "depth.png"
    assert checks(dlama.diagnose(*files, fov=75, depth_scale=5000)) == ["understood"]
    found = dlama.diagnose(*write(tmp_path), fov=75)
    assert checks(found) == ["understood"]
    assert found[0].line.startswith("image.png, depth.png: nothing wrong: 128x128, 75 degrees wide, depth 1.")


def test_an_angle_in_radians_is_named_and_no_unit_is_guessed(tmp_path: Path) -> None:
    lens, _ = dlama.diagnose(*write(tmp_path, codes(5000)), fov=np.radians(75))
    assert (lens.check, lens.mend) == ("fov-radians", "give `fov=75`")


@pytest.mark.parametrize("orientation", [3, 6])
def test_a_tag_that_one_of_the_two_has(tmp_path: Path, orientation: int) -> None:
    """A fault where the pixels fit as they are stored, and nothing is called turned then; a note where the tag is right."""
    image, depth = write(tmp_path)
    tags = Image.Exif()
    tags[0x0112] = orientation
    Image.open(image).save(image, exif=tags)
    found = dlama.diagnose(image, depth, fov=75)
    assert checks(found) == ["orientation", "understood"]
    assert found[0].severity == "fault" and "exiftool" in found[0].mend
    Image.fromarray(np.rot90(scene()[0], {3: 2, 6: 1}[orientation])).save(image, exif=tags)
    found = dlama.diagnose(image, depth, fov=75)
    assert checks(found) == ["orientation", "understood"] and found[0].severity == "note"


def test_a_camera_that_exif_contradicts(tmp_path: Path) -> None:
    """Oracle: 80 mm of 35 mm film see 21.7 degrees of a square picture."""
    _, depth = write(tmp_path)
    tags = Image.Exif()
    tags.get_ifd(0x8769)[0xA405] = 80
    Image.fromarray(scene()[0]).save(tmp_path / "image.jpg", exif=tags, quality=95)
    found = dlama.diagnose(tmp_path / "image.jpg", depth, fov=75)
    assert checks(found) == ["field-of-view", "understood"] and "EXIF data say 21.7" in found[0].what


def test_masks(tmp_path: Path) -> None:
    image, depth = write(tmp_path)
    mask = tmp_path / "mask.png"
    Image.fromarray((scene()[2] * 255).astype(np.uint8)).save(mask)
    assert checks(dlama.diagnose(image, depth, mask, fov=75)) == ["understood"]
    assert checks(dlama.diagnose(image, depth, mask, fov=75, mask_polarity="known")) == ["inverted-mask", "understood"]
    Image.fromarray((scene()[2] * 255).astype(np.uint8)[::2]).save(mask)
    assert checks(dlama.diagnose(image, depth, mask, fov=75)) == ["reading"]


def test_what_the_reader_refuses_is_the_finding(tmp_path: Path) -> None:
    """Law: the message of `read_rgbd`, with the option that it names."""
    image, depth = write(tmp_path, codes()[::2, ::2])
    (tmp_path / "bad.png").write_bytes(b"nothing")
    np.save(tmp_path / "negative.npy", -scene()[1])
    eight = tmp_path / "eight.png"
    Image.fromarray(np.clip(scene()[1] * 10, 0, 255).astype(np.uint8)).save(eight)
    for files, said in (
        ((image, depth), "resize_depth=guided"),
        ((image, eight), "8-bit"),
        ((image, tmp_path / "negative.npy"), "negative"),
        ((image, tmp_path / "none.png"), "no such file"),
        ((tmp_path / "bad.png", depth), "no readable PNG"),
    ):
        (found,) = dlama.diagnose(*files, fov=75)
        assert (found.check, found.severity, found.confidence) == ("reading", "fault", 1) and said in found.what
    assert checks(dlama.diagnose(image, depth, fov=75, resize_depth="nearest")) == ["understood"]
    assert "`fov`" in dlama.diagnose(*write(tmp_path))[0].what
    assert checks(dlama.diagnose(image)) == ["photo-depth", "understood"]


def test_inverse_depth_of_a_network_is_named_and_taken(tmp_path: Path) -> None:
    """Law: the option that a finding names mends it (oracle: the scene's depth, inverted and normalised to 16 bits)."""
    inverse = 1 / scene()[1]
    files = write(tmp_path, np.round(inverse / inverse.max() * 65535).astype(np.uint16))
    (found, _) = dlama.diagnose(*files, fov=75)
    assert found.check == "inverse-depth" and "`inverse_depth`, where a network gave it" in found.mend
    assert checks(dlama.diagnose(*files, fov=75, inverse_depth=True)) == ["understood"]
