"""What options do to a result, from the command line to the files (oracles: closed forms, the same input written anew)."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
from PIL import Image
from running import FAST, pixels, run

from dlama.files.rasters.depth import read_depth

REMOVE = ("remove", "image.png", "depth.png", "mask.png", "--fov", 60, "--only", "depth,hole", *FAST)
PIVOT_M = 2.5


def pose_of(frame: Path, *words: object) -> np.ndarray:
    """The pose that meta.json tells of the new camera."""
    out = run(frame, "view", "image.png", "depth.png", "--fov", 60, "--only", "hole", *words, *FAST)
    return np.array(json.loads((out / "meta.json").read_text())["cameras"][0]["world_from_cam"])


def hole_of(frame: Path, *words: object) -> np.ndarray:
    """hole.png of the picture without its object, seen from where it was taken, as bool."""
    return pixels(run(frame, *REMOVE, *words) / "hole.png") == 255


def known_depth(frame: Path, depth: str, *words: object) -> tuple[np.ndarray, np.ndarray]:
    """depth.exr of the same, and where it was known before anything was filled."""
    command = [depth if word == "depth.png" else word for word in REMOVE]
    out = run(frame, *command, *words)
    return read_depth(out / "depth.exr"), pixels(out / "hole.png") == 0


def test_pitch_lifts_the_camera(frame: Path) -> None:
    """Closed form: up is -y, and the axis still meets the pivot."""
    pose = pose_of(frame, "--pitch", 20, "--pivot", PIVOT_M)
    assert pose[1, 3] == pytest.approx(-PIVOT_M * np.sin(np.radians(20)))
    assert pose[:3, 3] + PIVOT_M * pose[:3, 2] == pytest.approx([0, 0, PIVOT_M])


def test_pivot_is_where_the_axis_stays(frame: Path) -> None:
    """Closed form of --pivot 4 and of the depth's median for `auto`, the default."""
    median = float(np.median(pixels(frame / "depth.png"))) / 1000
    for words, distance in ((["--pivot", "4"], 4.0), (["--pivot", "auto"], median), ([], median)):
        pose = pose_of(frame, "--yaw", 10, *words)
        assert pose[:3, 3] + distance * pose[:3, 2] == pytest.approx([0, 0, distance], abs=1e-3)


def test_dolly_moves_along_the_axis(frame: Path) -> None:
    """Closed form."""
    assert pose_of(frame, "--dolly", -0.5)[:3, 3] == pytest.approx([0, 0, -0.5])


def test_pixel_center_shifts_the_principal_point(frame: Path) -> None:
    """Closed form: OpenCV's 31.5 of 64 pixels is the middle."""
    out = run(frame, "view", "image.png", "depth.png", "--fx", 55, "--cx", 31.5, "--cy", 23.5, "--pixel-center", 0.0,
              "--yaw", 3, "--only", "hole", *FAST)  # fmt: skip
    camera = json.loads((out / "meta.json").read_text())["source_camera"]
    assert (camera["cx"], camera["cy"]) == (32.0, 24.0)


def test_depth_scale_and_far(frame: Path) -> None:
    """Closed form: 500 units per metre double what is millimetres by default; at and beyond 8.5 m all is sky."""
    units = pixels(frame / "depth.png") + 10 * np.arange(64, dtype=np.uint16)
    Image.fromarray(units).save(frame / "depth.png")
    depth, known = known_depth(frame, "depth.png", "--depth-scale", 500)
    np.testing.assert_allclose(depth[known], units[known] / 500, rtol=1e-6)
    depth, known = known_depth(frame, "depth.png", "--depth-scale", 500, "--far", 8.5)
    np.testing.assert_array_equal(np.isinf(depth[known]), units[known] / 500 >= 8.5)


def test_resize_depth_takes_the_nearest(frame: Path) -> None:
    """Closed form: of a depth map of half the size each reading stands for 2 x 2 pixels."""
    half = pixels(frame / "depth.png")[::2, ::2] + np.arange(32, dtype=np.uint16)
    Image.fromarray(half).save(frame / "half.png")
    depth, known = known_depth(frame, "half.png", "--resize-depth", "nearest")
    np.testing.assert_allclose(depth[known], half.repeat(2, 0).repeat(2, 1)[known] / 1000, rtol=1e-6)


def test_channel_names_which_depth(frame: Path) -> None:
    """Round trip: of two channels of one EXR file, the one that is named."""
    metres = pixels(frame / "depth.png").astype(np.float32) / 1000
    channels = {"Z": metres, "back": metres + 1}
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(frame / "both.exr"))
    for words, shift in (((), 0), (("--channel", "back"), 1)):
        depth, known = known_depth(frame, "both.exr", *words)
        np.testing.assert_allclose(depth[known], metres[known] + shift, rtol=1e-6)


def test_mask_polarity_and_soft_mask(frame: Path) -> None:
    """The same mask, written inverted or in grey, leaves the same hole (oracle: the mask itself)."""
    plain, mask = hole_of(frame), pixels(frame / "mask.png")
    Image.fromarray(255 - mask).save(frame / "mask.png")
    np.testing.assert_array_equal(hole_of(frame, "--mask-polarity", "known"), plain)
    Image.fromarray(np.where(mask > 0, 140, 110).astype(np.uint8)).save(frame / "mask.png")
    np.testing.assert_array_equal(hole_of(frame, "--soft-mask"), plain)


@pytest.mark.parametrize("pixels_grown", [0, 4])
def test_dilate_grows_the_mask(frame: Path, pixels_grown: int) -> None:
    """Oracle: OpenCV's distance to the mask: every pixel within the radius is a hole, none a pixel further."""
    away = cv2.distanceTransform((pixels(frame / "mask.png") == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    hole = hole_of(frame, "--dilate", pixels_grown)
    assert hole[away <= pixels_grown].all() and not hole[away > pixels_grown + 1].any()


def test_dilate_holes_grows_the_holes_of_the_new_view(frame: Path) -> None:
    """Oracle: OpenCV's distance to the holes as they are without it."""
    words = ("view", "image.png", "depth.png", "--fov", 60, "--yaw", 12, "--only", "hole", *FAST)
    plain = pixels(run(frame, *words) / "hole.png")
    grown = pixels(run(frame, *words, "--dilate-holes", 2) / "hole.png") == 255
    away = cv2.distanceTransform((plain == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    assert grown[away <= 2].all() and not grown[away > 3].any()


def test_depth_by_says_what_fills_depth(frame: Path) -> None:
    """Closed form: behind the box surfaces continue the plane of a slanted wall (1/z is linear), telea diffuses."""
    wall = (1 / (0.25 - 0.002 * np.arange(64)) + np.zeros((48, 1))).astype(np.float32)
    Image.fromarray((wall * 1000).round().astype(np.uint16)).save(frame / "depth.png")
    wrong = {}
    for word in ("surfaces", "filler"):
        depth, known = known_depth(frame, "depth.png", "--depth-by", word, "--dilate", 0)
        wrong[word] = np.abs(depth - wall)[~known].max()
    assert wrong["surfaces"] < 0.02 < 3 * 0.02 < wrong["filler"]
