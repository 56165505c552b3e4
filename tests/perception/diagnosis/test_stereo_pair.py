"""Findings on pairs: a good pair corrupted on purpose (that is the oracle); good ones raise no doubt."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

import dlama
from dlama.errors import InputError
from dlama.perception.diagnosis.stereo_pair import (
    check_pair,
    find_many_unmatched,
    find_pair_fault,
    match_corners,
    refuse_identical,
)

Array = np.ndarray
DEPTH = dlama.read_rgbd(dlama.example() / "street.jpg", dlama.example() / "depth.png", fov=90).depth
KNOWN = np.float32(256 * 0.12) / DEPTH
"""px, of the pair that comes with the package: focal length times baseline over depth."""


def demo() -> tuple[Array, Array]:
    """The pair that comes with the package."""
    return dlama.read_color(dlama.example() / "street.jpg"), dlama.read_color(dlama.example() / "right.jpg")


def turned(picture: Array, degrees: float) -> Array:
    """The picture turned about its middle."""
    height, width = picture.shape[:2]
    return cv2.warpAffine(picture, cv2.getRotationMatrix2D((width / 2, height / 2), degrees, 1), (width, height))


def test_a_good_pair_raises_no_doubt() -> None:
    """Law: rows match and objects are farther left in the right picture."""
    left, right = demo()
    assert find_pair_fault(left, right, KNOWN) is None and check_pair(left, right) == []
    offsets = match_corners(left, right).offsets
    assert len(offsets) > 300 and np.median(abs(offsets[:, 1])) < 0.3 and (offsets[:, 0] > 0).mean() > 0.9


@pytest.mark.parametrize(("name", "units"), [("cone", 4), ("Cloth3", 2), ("motorcycle", 1)])
def test_middlebury_raises_no_doubt(data_dir: Path, name: str, units: int) -> None:
    """Law: published rectified pairs with their true disparity; in other units it is not theirs."""
    folder = data_dir / "data" / (name if name == "motorcycle" else f"stereo/{name}")
    left, right = dlama.read_color(folder / "left.png"), dlama.read_color(folder / "right.png")
    file = folder / "disp_left.png"
    stored = cv2.imread(str(file), -1) if file.is_file() else np.load(folder / "disparity.npz")["disparity"]
    true = np.where(np.isfinite(stored), stored, 0).astype(np.float32) / units
    assert find_pair_fault(left, right, true) is None
    assert "in pixels" in str(find_pair_fault(left, right, 2 * true))


@pytest.mark.parametrize(
    "given",
    [np.where(np.isinf(DEPTH), 0, DEPTH), 4 * KNOWN, KNOWN / 256, -KNOWN],
    ids=["depth", "x4", "/256", "negative"],
)
def test_the_disparity_of_something_else_is_named(given: Array) -> None:
    """Oracle: the corruption of the true one; one that nearly no corner has is not judged."""
    assert "the disparity is that of only" in str(find_pair_fault(*demo(), given))
    few = np.where(np.indices(given.shape)[0] < 500, np.float32(0), given)
    assert "the disparity" not in str(find_pair_fault(*demo(), few))


Pair = Callable[[Array, Array], tuple[Array, Array]]
FAULTS: dict[str, tuple[Pair, str, str]] = {
    "swapped": (lambda left, right: (right, left), "swapped", "swapped"),
    "exchanged channels, right": (lambda left, right: (left, right[..., ::-1]), "channels", "BGR read as RGB"),
    "exchanged channels, left": (lambda left, right: (left[..., ::-1], right), "channels", "BGR read as RGB"),
    "3 px down": (lambda left, right: (left, np.roll(right, 3, 0)), "unrectified", "rectified"),
    "turned by 1 degree": (lambda left, right: (left, turned(right, 1)), "unrectified", "rectified"),
    "turned by -0.7 degrees": (lambda left, right: (left, turned(right, -0.7)), "unrectified", "rectified"),
    "60 px down": (lambda left, right: (left, np.roll(right, 60, 0)), "unrectified", "their corners lie 60"),
    "45 px up": (lambda left, right: (left, np.roll(right, -45, 0)), "unrectified", "their corners lie 45"),
    "mirrored right": (lambda left, right: (left, np.fliplr(right)), "mirrored", "mirrored"),
    "mirrored left": (lambda left, right: (np.fliplr(left), right), "mirrored", "mirrored"),
    "upside down": (lambda left, right: (left, np.flipud(right)), "mirrored", "mirrored"),
    "quarter turn": (lambda left, right: (left, np.rot90(right)), "turned", "turned by 90 degrees"),
    "half turn": (lambda left, right: (left, np.rot90(right, 2)), "turned", "turned by 180 degrees"),
}
"""Rows that are off by more than a twentieth of the height are no other scene; symmetric objects match in mirrored pictures."""


@pytest.mark.parametrize("name", FAULTS)
def test_what_is_wrong_with_a_pair_is_named(name: str) -> None:
    """Oracle: the corruption."""
    corrupt, check, words = FAULTS[name]
    pair = corrupt(*demo())
    (finding,) = check_pair(*pair)
    assert (finding.check, finding.severity) == (f"{check}-pair", "fault")
    assert finding.what == find_pair_fault(*pair, KNOWN) and words in finding.what


def test_rows_that_are_off_are_counted() -> None:
    """Oracle: by how much the right picture was rolled down; of a turned one there is no such number."""
    left, right = demo()
    for px in (5, 30):
        (finding,) = check_pair(left, np.roll(right, px, 0))
        assert finding.mend.startswith(f"move the right picture up by {px}.0 px, or rectify the pair")
    assert check_pair(left, turned(right, 1))[0].mend.startswith("rectify the pair")


def test_exposure_of_a_pair_is_a_note() -> None:
    left, right = demo()
    (finding,) = check_pair(left, (right * 0.6).astype(np.uint8))
    assert (finding.check, finding.severity) == ("exposure", "note") and " 0.6" in finding.what
    (finding,) = check_pair(left, np.clip(right * 3.0, 0, 255).astype(np.uint8))
    assert (finding.check, finding.mend) == ("exposure", "expose both alike") and "is white" in finding.what


@pytest.mark.parametrize("hw", [(1, 1), (4, 300), (62, 200)])
def test_pairs_too_small_for_corners_are_not_judged(hw: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    left, right = (rng.integers(0, 255, (*hw, 3), np.uint8) for _ in range(2))
    assert [each for each in check_pair(left, right) if each.severity == "fault"] == []


def test_another_white_balance_and_grey_pictures_raise_no_doubt() -> None:
    """Law: their channels are not exchanged."""
    left, right = demo()
    warm = np.clip(right * np.array([1.2, 1, 0.7]), 0, 255).astype(np.uint8)
    assert find_pair_fault(left, warm, KNOWN) is None
    grey = [np.repeat(each[..., 1:2], 3, 2) for each in (left, right)]
    assert find_pair_fault(*grey, KNOWN) is None


def test_one_picture_twice_with_noise() -> None:
    """Oracle: the corruption: none, or 3 levels of noise, as storing it anew may leave."""
    left, _ = demo()
    assert [each.check for each in check_pair(left, left)] == ["identical-pair"]
    noise = np.random.default_rng(0).normal(0, 3, left.shape)
    assert "one and the same" in str(find_pair_fault(left, np.clip(left + noise, 0, 255).astype(np.uint8), KNOWN))


def test_pictures_of_different_scenes() -> None:
    """Oracle: the corruption: noise shares no corner with the left picture, and a flat one has none."""
    left, _ = demo()
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8).repeat(8, 0).repeat(8, 1)
    assert "same scene" in str(find_pair_fault(left, noise, KNOWN))
    assert [each.check for each in check_pair(left, noise) if each.severity == "fault"] == ["unrelated-pair"]
    assert find_pair_fault(left, np.full_like(left, 90), KNOWN) is None


def test_plain_pictures_are_judged_by_their_matches() -> None:
    """Law: without corners nothing is said of them, but that hardly anything was matched."""
    plain = np.full((60, 80, 3), 100, np.uint8)
    known = np.zeros((60, 80), np.float32)
    assert "only 0%" in str(find_pair_fault(plain, plain, known))
    assert find_pair_fault(plain, plain, known + 1) is None


def test_sky_that_finds_no_match_is_not_warned_of() -> None:
    """Law: half of a picture without a match is warned of, unless it is plain blue sky over what is matched outdoors."""
    left, _ = demo()
    upper = np.indices(left.shape[:2])[0] < len(left) // 2
    depth = np.where(upper, 0, 9).astype(np.float32)
    assert "50% of the left picture finds no match" in str(find_many_unmatched(left, depth))
    assert find_many_unmatched(np.where(upper[..., None], np.uint8([140, 170, 210]), left), depth) is None
    assert find_many_unmatched(left, np.where(upper & (upper.cumsum(0) % 4 > 0), 9, depth).astype(np.float32)) is None


def test_identical_pictures_are_refused() -> None:
    """Law: not where a picture shows nothing."""
    left, right = demo()
    refuse_identical(left, right)
    refuse_identical(np.zeros_like(left), np.zeros_like(left))
    with pytest.raises(InputError, match="identical"):
        refuse_identical(left, left.copy())
