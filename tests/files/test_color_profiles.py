"""Colour profiles: closed form of Adobe RGB against sRGB's primaries and curve; what needs no change stays bit for bit."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms

import dlama
from box_frame import pixels, small_frame

GAMMA = 563 / 256
ADOBE = np.array([[0.60974, 0.20528, 0.14919], [0.31111, 0.62567, 0.06322], [0.01947, 0.06087, 0.74457]])
SRGB = np.array([[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]])
"""Columns: X, Y, Z (D50) of red, green and blue, as the profiles of both spaces state them."""


def matrix_profile(primaries: np.ndarray, gamma: float) -> bytes:
    """An ICC profile (version 2, display) of three primaries and one curve; ICC.1:2001-04, 6.1 and 6.5."""
    fixed = lambda values: b"".join(struct.pack(">i", round(value * 65536)) for value in values)  # noqa: E731
    xyz = lambda values: b"XYZ \0\0\0\0" + fixed(values)  # noqa: E731
    text = b"wide\0"
    tags = {
        b"desc": b"desc\0\0\0\0" + struct.pack(">I", len(text)) + text + bytes(78),
        b"wtpt": xyz((0.9642, 1, 0.8249)),
    }
    for name, column in zip((b"r", b"g", b"b"), primaries.T):
        tags[name + b"XYZ"] = xyz(column)
        tags[name + b"TRC"] = b"curv\0\0\0\0" + struct.pack(">IH", 1, round(gamma * 256)) + b"\0\0"
    tags[b"cprt"] = b"text\0\0\0\0none\0\0\0\0"
    table, data, at = struct.pack(">I", len(tags)), b"", 128 + 4 + 12 * len(tags)
    for name, tag in tags.items():
        tag += bytes(-len(tag) % 4)
        table += name + struct.pack(">II", at + len(data), len(tag))
        data += tag
    head = struct.pack(">I4sI4s4s4s", at + len(data), b"none", 0x02100000, b"mntr", b"RGB ", b"XYZ ") + bytes(12)
    head += b"acsp" + bytes(28) + fixed((0.9642, 1, 0.8249))
    return head + bytes(128 - len(head)) + table + data


def in_srgb(color: np.ndarray) -> np.ndarray:
    """Adobe RGB levels in sRGB, closed form; clipped."""
    linear = np.clip((color / 255) ** GAMMA @ ADOBE.T @ np.linalg.inv(SRGB).T, 0, 1)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


@pytest.fixture
def color() -> np.ndarray:
    levels = np.linspace(0, 255, 16).astype(np.uint8)
    return np.stack(np.meshgrid(levels, levels, levels), -1).reshape(64, 64, 3)


@pytest.mark.parametrize("suffix", ["png", "tif", "webp"])
def test_colours_of_another_space_become_srgb(color: np.ndarray, suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"wide.{suffix}"
    lossless = {"lossless": True} if suffix == "webp" else {}
    Image.fromarray(color).save(file, icc_profile=matrix_profile(ADOBE, GAMMA), **lossless)
    read, truth = dlama.read_color(file), in_srgb(color)
    bright = color.min(axis=2) > 16  # near black LittleCMS ends sRGB's curve in a straight line of its own
    assert np.abs(read[bright] - truth[bright]).max() < 2
    assert np.abs(read.astype(int) - color).max() > 30


def test_srgbs_own_profile_changes_no_bit(color: np.ndarray, tmp_path: Path) -> None:
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.fromarray(color).save(tmp_path / "s.png", icc_profile=profile)
    assert (dlama.read_color(tmp_path / "s.png") == color).all()


def test_grey_stays_grey(tmp_path: Path) -> None:
    grey = np.repeat(np.arange(256, dtype=np.uint8)[None], 4, axis=0)
    Image.fromarray(grey).save(tmp_path / "grey.png", icc_profile=matrix_profile(ADOBE, GAMMA))
    read = dlama.read_color(tmp_path / "grey.png")
    assert np.abs(read[..., 0].astype(int) - grey).max() <= 10 and np.ptp(read, axis=2).max() <= 1


def test_classes_keep_their_codes(tmp_path: Path) -> None:
    profile = matrix_profile(ADOBE, GAMMA)
    classes = np.zeros((8, 8, 3), np.uint8)
    classes[2:5, 2:5] = (200, 30, 90)
    Image.fromarray(classes).save(tmp_path / "semantic.png", icc_profile=profile)
    assert dlama.read_mask(tmp_path / "semantic.png", mask_class="200,30,90").sum() == 9


def test_cmyk_without_a_usable_profile_is_read_as_before(color: np.ndarray, tmp_path: Path) -> None:
    picture = Image.fromarray(color).convert("CMYK")
    picture.save(tmp_path / "ink.tif", icc_profile=matrix_profile(ADOBE, GAMMA))
    assert (dlama.read_color(tmp_path / "ink.tif") == np.asarray(picture.convert("RGB"))).all()


def test_a_damaged_profile_is_named_and_left_aside(color: np.ndarray, tmp_path: Path) -> None:
    Image.fromarray(color).save(tmp_path / "odd.png", icc_profile=b"no profile at all" * 20)
    with pytest.warns(UserWarning, match=r"odd.png: its colour profile cannot be used"):
        assert (dlama.read_color(tmp_path / "odd.png") == color).all()
    Image.fromarray(color).save(tmp_path / "plain.png")
    assert (dlama.read_color(tmp_path / "plain.png") == color).all()


def test_a_plate_of_16_bits_in_another_space_becomes_srgb_in_8(tmp_path: Path) -> None:
    """Oracle: the completed view; the file's own numbers are not sRGB and must not be mixed in."""
    plate = pixels(small_frame(tmp_path) / "image.png").astype(np.uint16) * 257
    profile = matrix_profile(ADOBE, GAMMA)
    tifffile.imwrite(tmp_path / "plate.tif", plate, photometric="rgb", iccprofile=profile)
    with pytest.warns(UserWarning, match=r"plate\.tif: has 16 bits a channel"):
        rgbd = dlama.read_rgbd(tmp_path / "plate.tif", tmp_path / "depth.png", fov=60)
    assert not np.array_equal(rgbd.color, plate >> 8)
    done = dlama.remove(rgbd, dlama.read_mask(tmp_path / "mask.png"), filler="telea")
    out = dlama.write(done, tmp_path / "out", inputs={"image": tmp_path / "plate.tif"}, only=["image"])
    assert np.array_equal(pixels(out / "image.png"), done.view.color)
