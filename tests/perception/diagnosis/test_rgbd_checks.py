"""Checks of a picture with depth (oracle: the corruption that was put in; good inputs have none)."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import dlama
from corruptions import FULL, MM, SPOILT, observed, stored
from dlama.geometry.camera import Camera
from dlama.perception.diagnosis.depth_code import check_depth_code
from dlama.perception.diagnosis.depth_scale import check_value_range, measure_extent
from dlama.perception.diagnosis.finding import Finding, Observed, certainty, describe_probability
from dlama.perception.diagnosis.lens import check_exif, check_lens
from dlama.perception.diagnosis.registration import check_mask_registration
from dlama.perception.diagnosis.rgbd_checks import check_mask_coverage, check_terraces, run_checks
from dlama.worlds.layouts.random_scene import build
from marks import first_quick

SEEDS = (5, 14)
EYE = 1.2, 1.6
"""Metres above the ground at which worlds have their cameras."""


@cache
def world(seed: int) -> Observed:
    made = build(seed, "street" if seed % 2 else "room", ())
    camera = made.camera(0, 256, 75)
    seen = made.raycast(camera)
    return observed(dlama.RGBD(seen.color, seen.depth, camera), seen.group == made.object_index)


def shift_of(finding: Finding) -> np.ndarray:
    """Right and down, px, as the line says."""
    found = {word: int(number) for number, word in re.findall(r"(\d+) px too far (\w+)", finding.what)}
    return np.array([found.get("right", 0) - found.get("left", 0), found.get("down", 0) - found.get("up", 0)])


def faults(seen: Observed) -> set[str]:
    return {finding.check for finding in run_checks(seen) if finding.severity == "fault"}


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_is_wrong_with_worlds(seed: int) -> None:
    assert run_checks(world(seed)) == []


@pytest.mark.parametrize(("name", "seed"), list(zip(SPOILT, SEEDS * len(SPOILT))))
def test_what_was_spoilt_is_named(name: str, seed: int) -> None:
    spoil, expected = SPOILT[name]
    assert faults(spoil(world(seed))) & set(expected)


def test_ground_and_unit_are_found() -> None:
    """Oracle: the height at which the world put its camera, and the unit that depth was written in."""
    extent = measure_extent(world(3))
    assert extent is not None and extent.floor is not None and EYE[0] - 0.02 < extent.floor < EYE[1] + 0.02
    spoil, _ = SPOILT["1/5000 m read as mm"]
    (finding,) = run_checks(spoil(world(3)))
    assert "1/5000 m" in finding.what and finding.mend == "give `depth_scale=5000`"


@pytest.mark.parametrize("metres", [8.0, 20.0])
def test_depth_that_was_cut_off_may_have_any_unit(metres: float) -> None:
    """Oracle: 0..metres stretched to 16 bits, cut off where it is deeper: none of the usual units, so none is certain."""
    seen = world(5)
    values = np.minimum(np.where(seen.depth > 0, seen.depth * FULL / metres, 0), FULL)
    (finding,) = run_checks(stored(seen, np.where(values == FULL, np.inf, values)))
    assert finding.check == "depth-scale" and f"they end at {FULL}, which" in finding.what
    assert "65535 over the metres at which depth was cut off (10 m: `depth_scale=6553.5`)" in finding.mend
    assert describe_probability(finding.confidence) == "perhaps"


def test_a_close_range_is_doubted_with_a_perhaps() -> None:
    """Oracle: a world a tenth as large, half of it within half a metre, as the shelf of a robot: its millimetres are right."""
    seen = world(14)
    (finding,) = run_checks(replace(seen, depth=np.round(seen.depth * MM / 10) / MM))
    assert finding.check == "depth-scale" and describe_probability(finding.confidence) == "perhaps"
    assert finding.mend.endswith(", unless the scene is that near, as a close-range camera's")


def test_millimetres_that_are_cut_off_at_65_metres_are_in_order() -> None:
    """Oracle: the world's own depth, with a few pixels at 60 m and a few beyond what 16 bits can say, and a hand at 0.45 m."""
    seen = world(5)
    depth = np.where(np.isposinf(seen.depth), 0, seen.depth)
    depth[:2, :20], depth[2, :3], depth[-20:, -30:] = np.inf, 60, 0.45
    assert check_value_range(replace(seen, depth=depth)) == []
    assert [each.check for each in check_value_range(SPOILT["normalised"][0](seen))] == ["normalised-depth"]


@pytest.mark.parametrize(("right", "down"), [(14, 0), (-9, 5), (0, -12)])
def test_the_shift_is_given(right: int, down: int) -> None:
    """Oracle: by how much depth was rolled, to within a pixel."""
    seen = world(3)
    rolled = np.roll(seen.depth, (down, right), (0, 1))
    (finding,) = run_checks(replace(seen, depth=rolled))
    assert finding.check == "shifted-depth"
    assert np.abs(shift_of(finding) - (right, down)).max() <= 1


def test_a_depth_map_of_few_pixels_says_nothing() -> None:
    seen = world(3)
    few = np.where(np.arange(seen.depth.size).reshape(seen.depth.shape) % 997 == 0, seen.depth, 0)
    assert run_checks(replace(seen, depth=few)) == []
    assert run_checks(replace(seen, depth=0 * few)) == []


MASK_SEEDS = (6, 15, 18)
FLIPPED = {
    "mirrored left to right": lambda mask: mask[:, ::-1],
    "upside down": lambda mask: mask[::-1],
    "turned by 180 degrees": lambda mask: mask[::-1, ::-1],
}


@pytest.mark.parametrize(("how", "seed"), list(zip(FLIPPED, MASK_SEEDS)))
def test_a_mirrored_mask_is_named(how: str, seed: int) -> None:
    """Oracle: how the mask was flipped."""
    seen = world(seed)
    assert seen.mask is not None and check_mask_registration(seen) == []
    (finding,) = check_mask_registration(replace(seen, mask=np.ascontiguousarray(FLIPPED[how](seen.mask))))
    assert (finding.check, finding.severity) == ("mirrored-mask", "fault") and how in finding.what


@pytest.mark.parametrize("seed", MASK_SEEDS)
@pytest.mark.parametrize(("right", "down"), [(15, 0), (-8, 10)])
def test_a_shifted_mask_is_named_with_its_shift(right: int, down: int, seed: int) -> None:
    """Oracle: by how much the mask was moved, to within two pixels."""
    seen = world(seed)
    assert seen.mask is not None
    (finding,) = check_mask_registration(replace(seen, mask=np.roll(seen.mask, (down, right), (0, 1))))
    assert (finding.check, finding.severity) == ("shifted-mask", "fault")
    assert np.abs(shift_of(finding) - (right, down)).max() <= 2


@pytest.mark.parametrize(
    ("camera", "check", "mend"),
    [
        (Camera(640, 480, 1052, 1052, 640, 480), "intrinsics-size", ""),
        (Camera(640, 480, 526, 526, 240, 320), "principal-point", "give `cx=320` `cy=240`"),
        (Camera(640, 480, 526, 526, 450, 240), "principal-point", ""),
        (Camera(640, 480, 0.8, 0.8, 320, 240), "focal-length", "give `fx=512`"),
        (Camera(640, 480, 526, 400, 320, 240), "pixel-shape", ""),
        (Camera(640, 480, 100, 100, 320, 240), "field-of-view", ""),
        (Camera.from_fov(640, 480, 1.57), "fov-radians", ""),
        (Camera(640, 480, 9000, 9000, 320, 240), "field-of-view", ""),
        (Camera(640, 480, 526, 526, 320, 237), None, ""),
        (Camera(741, 500, 995, 995, 311, 255), None, ""),
        (Camera.from_fov(512, 512, 90), None, ""),
    ],
)
def test_lenses(camera: Camera, check: str | None, mend: str) -> None:
    """Those that are hardly so are named, with what was meant (.8 widths of 640 px are 512 px; cx and cy exchanged); usual ones
    pass."""
    found = check_lens(camera)
    assert [finding.check for finding in found] == ([] if check is None else [check])
    assert not mend or found[0].mend == mend


def test_a_camera_is_compared_with_exif() -> None:
    camera = Camera.from_fov(640, 480, 65)
    (finding,) = check_exif(camera, Camera.from_fov(640, 480, 28))
    assert finding.check == "field-of-view" and "say 28" in finding.what
    assert check_exif(camera, Camera.from_fov(640, 480, 66)) == []


def test_a_mask_of_a_few_pixels_is_a_note() -> None:
    seen = world(3)
    few = np.zeros(seen.depth.shape, np.bool_)
    few[100:102, 100:103] = True
    assert [(each.check, each.severity) for each in check_mask_coverage(replace(seen, mask=few))] == [
        ("tiny-mask", "note")
    ]
    few[102:104, 100:103] = True
    assert check_mask_coverage(replace(seen, mask=few)) == []


def test_how_sure_in_words() -> None:
    assert [describe_probability(sure) for sure in (0.95, 0.8, 0.6)] == ["certain", "likely", "perhaps"]
    assert certainty(0, 1) == 0.5 and certainty(1, 1) == 0.75 and certainty(50, 1) == 0.99
    assert Finding("x", "fault", 0.95, "a", "b").line == "a: b (certain)"
    assert Finding("x", "fault", 0.95, "are they swapped?", "swap them").line == "are they swapped? swap them (certain)"
    assert Finding("understood", "fine", 1.0, "a").line == "a"


@pytest.mark.skipif("DLAMA_DATA" not in os.environ, reason="needs DLAMA_DATA")
def test_the_bend_of_a_kinects_depth_is_reported_though_its_noise_is_as_large() -> None:
    """Oracle: distance along the ray that was put in; as it was recorded nothing is said."""
    folder = Path(os.environ["DLAMA_DATA"]) / "data" / "kitchen_sequence"
    files = zip(sorted((folder / "images").iterdir()), sorted((folder / "depth").iterdir()), strict=True)
    for color, depth in list(files)[::12]:
        seen = observed(dlama.read_rgbd(color, depth, camera=Camera(640, 480, 526, 526, 320, 237)))
        assert check_depth_code(seen) == []
        (finding,) = check_depth_code(SPOILT["radial"][0](seen))
        assert finding.check == "radial-depth"


@pytest.mark.skipif("DLAMA_DATA" not in os.environ, reason="needs DLAMA_DATA")
def test_the_smooth_depth_of_a_phone_is_doubted_with_a_perhaps() -> None:
    """Oracle: millimetres made from the disparity of a portrait by its file's range: depth. Hardly anything in it is flat."""
    folder = Path(os.environ["DLAMA_DATA"]) / "data" / "portrait"
    found = check_depth_code(observed(dlama.read_rgbd(folder / "color.jpg", folder / "depth.png", fov=69.4)))
    assert all(describe_probability(each.confidence) == "perhaps" for each in found)


@cache
def real_and_rendered() -> tuple[dlama.RGBD, ...]:
    """A Kinect's frame and a rendered street."""
    data = Path(os.environ["DLAMA_DATA"])
    kitchen = data / "data" / "kitchen_vpi" / "frame-000072"
    street = data / "street" / "s03" / "with" / "CameraComponent"
    return (
        dlama.read_rgbd(f"{kitchen}.color.jpg", f"{kitchen}.depth.png", camera=Camera(640, 480, 526, 526, 320, 237)),
        dlama.read_rgbd(street / "ColorImage" / "s03_with.0000.jpeg", street / "DepthMM" / "s03_with.0000.png", fov=90),
    )


@pytest.mark.skipif("DLAMA_DATA" not in os.environ, reason="needs DLAMA_DATA")
@pytest.mark.parametrize("name", first_quick([None, *SPOILT]))
def test_real_and_rendered_pictures(name: str | None) -> None:
    """Good and spoilt."""
    for number, rgbd in enumerate(real_and_rendered()):
        if name is None:
            assert run_checks(observed(rgbd)) == []
        elif name not in ("inverted mask", *(("normalised",) if number else ("1/256 m read as mm", "gamma 1/2.2"))):
            assert faults(SPOILT[name][0](observed(rgbd))) & set(SPOILT[name][1])


@pytest.mark.slow
@pytest.mark.parametrize("wh", [(1000, 80), (80, 1000), (640, 12), (400, 2), (5, 5), (4, 3), (1, 1)])
def test_strips_and_tiny_pictures_are_no_error(wh: tuple[int, int]) -> None:
    """Noise of any shape: findings, whatever they are, and no traceback."""
    rng, (width, height) = np.random.default_rng(0), wh
    values, color = rng.uniform(1, 3, (height, width)), rng.integers(0, 255, (height, width, 3), np.uint8)
    mask = rng.random((height, width)) < 0.3
    seen = Observed(color, values, Camera.from_fov(width, height, 60), mask)
    assert all(isinstance(finding, Finding) for finding in run_checks(seen))


def test_a_shift_is_found_in_a_strip() -> None:
    """Oracle: by how much depth was rolled, in the middle tenth of a picture."""
    seen = world(3)
    rows = slice(120, 145)
    rolled = np.roll(seen.depth, 14, 1)[rows]
    camera = seen.camera.cropped(0, 120, 256, 25)
    found = run_checks(Observed(seen.color[rows], rolled, camera))
    assert "shifted-depth" in [each.check for each in found]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_map_enlarged_by_the_nearest_pixel(seed: int) -> None:
    """Oracle: every fourth reading, four times in either direction; with the option that mends it."""
    seen = world(seed)
    terraced = replace(seen, depth=np.kron(seen.depth[2::4, 2::4], np.ones((4, 4))))
    (found,) = [each for each in check_terraces(terraced) if each.check == "terraces"]
    assert "64x64" in found.what and "resize_depth=guided" in found.mend
    assert not any(each.check == "terraces" for each in check_terraces(seen))
