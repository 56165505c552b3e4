"""The depth that photos carry (oracle: the depth that the files were written from, by the formulas of each specification)."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from depth_photos import (
    apple_xmp,
    dynamic_depth,
    gdepth,
    heic_with_depth,
    matte_xmp,
    multi_picture,
    packet,
    picture,
    segment,
    standard,
    with_segments,
)
from dlama.datasets.diagnosis import diagnose
from dlama.errors import DepthError
from dlama.files.photos.containers import find_baseline
from dlama.files.photos.depth import read_photo_depth
from dlama.files.rasters.pictures import read_color
from dlama.files.rgbd import read_rgbd
from dlama.geometry.rgbd import RGBD

WH = (128, 96)
K = np.array([[1000.0, 0, 500], [0, 1000, 380], [0, 0, 1]])
"""Of a reference size 1024 x 768."""
CODES = np.tile(np.linspace(0, 255, 64).astype(np.uint8), (48, 1))
PART = CODES / 255.0
RNG = np.random.default_rng(0)
COLOR = np.repeat(np.repeat(RNG.integers(0, 256, (12, 16, 3), np.uint8), 8, 0), 8, 1)
KNOWN = [(64.0, 48.0, 2.0)]
APPLE = apple_xmp(0.5, 4.0, K, (1024, 768))


def put(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def apple_jpeg(path: Path, xmp: bytes = APPLE, orientation: int = 1) -> Path:
    exif = Image.Exif()
    exif[0x0112] = orientation
    matte = with_segments(picture(CODES), standard(matte_xmp()))
    depth = with_segments(picture(CODES), standard(xmp))
    return put(path, multi_picture(picture(COLOR, exif=exif), [(0, matte), (0, depth)]))


def own_rgbd(path: Path, **options: Any) -> RGBD:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return read_rgbd(path, sharpen=False, **options)


def metres(rgbd: RGBD) -> np.ndarray:
    """At the centres of the depth picture's pixels: 2 x 2 pixels of the photo each, their mean in inverse depth."""
    return 1 / (1 / rgbd.depth.astype(np.float64)).reshape(48, 2, 64, 2).mean((1, 3))


def test_an_iphones_jpeg(tmp_path: Path) -> None:
    """Disparity in 1/m, linear from FloatMinValue to FloatMaxValue; the matte before it, called depth too, is not taken."""
    rgbd = own_rgbd(apple_jpeg(tmp_path / "IMG.jpg"))
    np.testing.assert_allclose(metres(rgbd)[:, 1:-1], (1 / (0.5 + 3.5 * PART))[:, 1:-1], rtol=0.02)
    about = dict(rgbd.estimate or {})
    assert about["estimator"] == "the photo's own depth" and about["source"] == "JPEG, Apple disparity"
    assert (about["accuracy"], about["scale"]["rule"], about["size"]) == ("relative", "photo", [64, 48])
    camera = rgbd.camera
    np.testing.assert_allclose((camera.fx, camera.fy, camera.cx, camera.cy), (125, 125, 62.5, 47.5))
    assert about["field_of_view"]["from"] == "the photo's calibration"


def test_an_iphones_heic(tmp_path: Path) -> None:
    """The same disparity, as a depth image of a HEIC file; a depth kind is metres."""
    rgbd = own_rgbd(heic_with_depth(tmp_path / "IMG.HEIC", COLOR, CODES, APPLE))
    np.testing.assert_allclose(metres(rgbd)[:, 1:-1], (1 / (0.5 + 3.5 * PART))[:, 1:-1], rtol=0.01)
    assert (rgbd.estimate or {})["source"] == "HEIC, Apple disparity" and rgbd.camera.fx == 125
    xmp = apple_xmp(0.5, 4.0, K, (1024, 768), "depth", "absolute")
    found = read_photo_depth(heic_with_depth(tmp_path / "lidar.heic", COLOR, CODES, xmp))
    assert found is not None and found.absolute
    np.testing.assert_allclose(1 / found.values, 0.5 + 3.5 * PART, rtol=1e-5)


def test_a_depth_image_that_says_nothing_is_not_used(tmp_path: Path) -> None:
    """Without SEI and XMP nobody knows what its numbers mean: estimated, with a line that says why."""
    path = heic_with_depth(tmp_path / "IMG.HEIC", COLOR, CODES, packet(""))
    with pytest.raises(DepthError, match=r"IMG.HEIC: the depth image in it has no word of what its numbers mean"):
        read_photo_depth(path)
    with pytest.warns(UserWarning, match=r"has no word .* mean; depth is estimated instead"):
        assert (read_rgbd(path, fov=60, metres_at=KNOWN).estimate or {})["estimator"] == "tcmonodepth"


@pytest.mark.parametrize("orientation", [3, 6])
def test_depth_and_calibration_turn_with_the_picture(tmp_path: Path, orientation: int) -> None:
    """Oracle: Pillow's own turning of the picture and of the codes; the principal point by turning a picture of it."""
    from PIL import ImageOps

    path = apple_jpeg(tmp_path / "IMG.jpg", orientation=orientation)
    exif = Image.Exif()
    exif[0x0112] = orientation
    turned = Image.fromarray(CODES)
    turned.info["exif"] = exif.tobytes()
    spot = Image.fromarray((np.indices((768, 1024)) == np.array([380, 500])[:, None, None]).all(0))
    spot.info["exif"] = exif.tobytes()
    rows, columns = np.nonzero(np.asarray(ImageOps.exif_transpose(spot)))
    found, shown = read_photo_depth(path), np.asarray(ImageOps.exif_transpose(turned))
    assert found is not None and found.camera is not None and found.values.shape == shown.shape
    np.testing.assert_allclose(found.values, 0.5 + 3.5 * shown / 255, atol=0.05)  # JPEG
    np.testing.assert_allclose((found.camera.cx * 8, found.camera.cy * 8), (columns[0], rows[0]), atol=1)
    assert found.camera.hw == read_color(path).shape[:2]


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize(
    ("how", "formula"),
    [
        ("RangeInverse", lambda part: 6.0 * 0.4 / (6.0 - part * (6.0 - 0.4))),
        ("RangeLinear", lambda part: 0.4 + part * (6.0 - 0.4)),
    ],
)
def test_gdepth(tmp_path: Path, how: str, formula: Any, extended: bool) -> None:
    """developers.google.com/depthmap-metadata/encoding; extension segments in any order."""
    found = read_photo_depth(put(tmp_path / "a.jpg", gdepth(COLOR, CODES, 0.4, 6.0, how, extended)))
    assert found is not None and found.metric and not found.along_ray
    np.testing.assert_allclose(1 / found.values, formula(PART), rtol=1e-5)


def test_gdepths_units_and_rays(tmp_path: Path) -> None:
    """Millimetres; and depth along the ray, which is sqrt(1 + x^2 + y^2) times that along the axis."""
    flat = np.full((48, 64), 51, np.uint8)
    data = gdepth(COLOR, flat, 1000, 6000, "RangeLinear", False, Units="mm", MeasureType="OpticalRay")
    rgbd = own_rgbd(put(tmp_path / "a.jpg", data), fov=90)
    v, u = (np.indices((96, 128)) + 0.5 - np.array([48, 64])[:, None, None]) / 64
    np.testing.assert_allclose(rgbd.depth, 2.0 / np.sqrt(1 + u**2 + v**2), rtol=6e-3)


def test_dynamic_depth(tmp_path: Path) -> None:
    """16 bits; the gain map between the photo and its depth is not taken for it. Without a unit it is relative."""
    codes = (PART * 65535).round().astype(np.uint16)
    found = read_photo_depth(put(tmp_path / "a.jpg", dynamic_depth(COLOR, codes, 0.3, 9.0)))
    assert found is not None and found.metric
    np.testing.assert_allclose(1 / found.values, 9.0 * 0.3 / (9.0 - PART * 8.7), rtol=1e-3)
    found = read_photo_depth(put(tmp_path / "b.jpg", dynamic_depth(COLOR, codes, 0.3, 9.0, units="None")))
    assert found is not None and not found.metric
    with pytest.raises(DepthError, match=r"c.jpg: the depth in it reaches from 9.0 to 0.3; 0 < near < far"):
        read_photo_depth(put(tmp_path / "c.jpg", dynamic_depth(COLOR, codes, 9.0, 0.3)))


def test_relative_depth_is_said_and_fitted(tmp_path: Path) -> None:
    """A line says that metres are the phone's guess; two known depths give factor and shift, so both come out as given."""
    path = apple_jpeg(tmp_path / "IMG.jpg")
    with pytest.warns(UserWarning, match=r"relative \(JPEG, Apple disparity\): its metres are the phone's guess"):
        read_rgbd(path, sharpen=False)
    rgbd = read_rgbd(path, sharpen=False, metres_at=[(20, 48, 5.0), (110, 48, 1.5)])
    assert (rgbd.estimate or {})["scale"]["rule"] == "metres_at"
    assert rgbd.depth[48, 20] == pytest.approx(5, rel=0.03) and rgbd.depth[48, 110] == pytest.approx(1.5, rel=0.03)


def test_much_depth_at_the_far_limit_is_said(tmp_path: Path) -> None:
    """A third of the codes say farthest: a line names the option, and that makes just these far, without the line."""
    codes = CODES.copy()
    codes[:16] = 255
    path = put(tmp_path / "a.jpg", gdepth(COLOR, codes, 0.4, 6.0, "RangeInverse", False))
    with pytest.warns(UserWarning, match=r"34% of its depth lie at the farthest .* 6 m, .*; `far=5.94`"):
        read_rgbd(path, fov=60, sharpen=False)
    assert read_rgbd(path, fov=60, sharpen=False, far=5.94).far.mean() == pytest.approx(1 / 3, abs=0.03)


def test_a_network_that_is_asked_for_is_used(tmp_path: Path) -> None:
    rgbd = own_rgbd(apple_jpeg(tmp_path / "IMG.jpg"), depth_model="tcmonodepth", fov=60)
    assert (rgbd.estimate or {})["estimator"] == "tcmonodepth"


def test_a_stereo_photo(tmp_path: Path) -> None:
    """A near square before a wall: 12 and 4 px of disparity; without a baseline only their difference is known."""
    wall = np.random.default_rng(3).integers(0, 256, (120, 200, 3), np.uint8)
    wall = np.asarray(Image.fromarray(wall).resize((400, 240), Image.Resampling.BICUBIC))
    left, right = wall.copy(), np.roll(wall, -4, 1)
    square = wall[60:180, :120][:, ::-1]
    left[60:180, 150:270], right[60:180, 138:258] = square, square
    pair = multi_picture(picture(left), [(0x020002, picture(right))])
    found = read_photo_depth(put(tmp_path / "a.mpo", pair))
    assert found is not None and not found.metric
    near, far = found.values[100:140, 180:240], found.values[10:40, 150:350]
    assert np.median(near) - np.median(far) == pytest.approx(8, abs=0.5)
    rgbd = own_rgbd(put(tmp_path / "a.jpg", pair), fov=60)
    assert rgbd.depth[120, 210] < rgbd.depth[20, 300]


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize(
    ("top", "bottom", "metres_apart"), [(77, 1000, 0.077), (65, 1, 65), (0xFFFFFFFF, 0xFFFFFFFF, None), (1, 0, None)]
)
def test_the_baseline_of_a_stereo_photo(order: str, top: int, bottom: int, metres_apart: float | None) -> None:
    """CIPA DC-007, written by hand: the attributes of a picture; all bits of both numbers set mean that it is unknown."""
    tags = struct.pack(f"{order}HHII", 0xB206, 5, 1, 26) + struct.pack(f"{order}III", 0, top, bottom)
    head = {"<": b"II*\0", ">": b"MM\0*"}[order] + struct.pack(f"{order}IH", 8, 1)
    data = with_segments(picture(COLOR), segment(0xE2, b"MPF\0" + head + tags))
    assert find_baseline(data) == metres_apart


def test_photos_without_depth(tmp_path: Path) -> None:
    """Plain JPEG and PNG; a further picture without a word on depth; XMP that declares entities; none of them has depth."""
    assert read_photo_depth(put(tmp_path / "a.jpg", picture(COLOR))) is None
    assert read_photo_depth(put(tmp_path / "a.png", picture(COLOR, "PNG"))) is None
    assert read_photo_depth(put(tmp_path / "b.jpg", multi_picture(picture(COLOR), [(0, picture(CODES))]))) is None
    evil = packet("").replace(b"<x:xmpmeta", b"<!DOCTYPE a [<!ENTITY b 'c'>]><x:xmpmeta")
    assert read_photo_depth(put(tmp_path / "c.jpg", with_segments(picture(COLOR), standard(evil)))) is None


def test_depth_of_another_field_of_view_is_not_used(tmp_path: Path) -> None:
    path = put(tmp_path / "a.jpg", gdepth(COLOR[:60], CODES, 0.4, 6.0, "RangeInverse", False))
    with pytest.warns(UserWarning, match=r"is 64x48 and the picture 128x60; .*not show the same; depth is est"):
        read_rgbd(path, fov=60, metres_at=KNOWN)


def test_doctor_says_what_a_photo_carries(tmp_path: Path) -> None:
    """Oracle: what was written; a picture without depth is none that is wrong."""
    *notes, last = diagnose(apple_jpeg(tmp_path / "IMG.jpg"))
    assert [note.severity for note in notes] == ["note"] and "relative" in notes[0].what
    seen = "128x96, 54.2 degrees wide, depth 0.25 to 2 m, depth of the photo (JPEG, Apple disparity), 64x48"
    assert f"IMG.jpg: nothing wrong: {seen}" in last.what
    first, _ = diagnose(put(tmp_path / "a.jpg", picture(COLOR)))
    assert first.what == "a.jpg: carries no depth: it is estimated, unless a depth file is given"
    _, framed, _ = diagnose(put(tmp_path / "c.jpg", picture(np.pad(COLOR, ((16, 16), (0, 0), (0, 0))))))
    bars = "15 px above and 15 px below"  # JPEG blurs one
    assert framed.line == f"c.jpg: the picture has bars, {bars}: crop them off (certain)"
    bad = put(tmp_path / "b.jpg", gdepth(COLOR, CODES, 6.0, 0.4, "RangeLinear", False))
    assert [found.severity for found in diagnose(bad)] == ["fault"]
