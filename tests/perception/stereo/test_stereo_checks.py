"""What is noticed of pairs that are none: a good pair corrupted on purpose (that is the oracle); good ones raise no doubt."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

import dlama
from dlama.errors import InputError
from dlama.perception.stereo.checks import find_many_unmatched, find_pair_fault, match_corners, refuse_identical

Array = np.ndarray
KNOWN = np.ones((512, 512), np.float32)


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
    assert find_pair_fault(left, right, KNOWN) is None
    offsets = match_corners(left, right).offsets
    assert len(offsets) > 300 and np.median(abs(offsets[:, 1])) < 0.3 and (offsets[:, 0] > 0).mean() > 0.9


@pytest.mark.parametrize("name", ["cone", "Cloth3", "motorcycle"])
def test_middlebury_raises_no_doubt(data_dir: Path, name: str) -> None:
    """Law: published rectified pairs."""
    folder = data_dir / "data" / (name if name == "motorcycle" else f"stereo/{name}")
    left, right = dlama.read_color(folder / "left.png"), dlama.read_color(folder / "right.png")
    assert find_pair_fault(left, right, np.ones(left.shape[:2], np.float32)) is None


def test_swapped_pictures() -> None:
    """Oracle: the corruption."""
    left, right = demo()
    assert "swapped" in str(find_pair_fault(right, left, KNOWN))


def test_exchanged_channels() -> None:
    """Oracle: the corruption, red and blue of either picture; another white balance and grey pictures raise no doubt."""
    left, right = demo()
    assert "BGR read as RGB" in str(find_pair_fault(left, right[..., ::-1], KNOWN))
    assert "BGR read as RGB" in str(find_pair_fault(left[..., ::-1], right, KNOWN))
    warm = np.clip(right * np.array([1.2, 1, 0.7]), 0, 255).astype(np.uint8)
    assert find_pair_fault(left, warm, KNOWN) is None
    grey = [np.repeat(each[..., 1:2], 3, 2) for each in (left, right)]
    assert find_pair_fault(*grey, KNOWN) is None


@pytest.mark.parametrize("corrupt", [lambda p: np.roll(p, 3, 0), lambda p: turned(p, 1), lambda p: turned(p, -0.7)])
def test_rows_that_do_not_match(corrupt) -> None:
    """Oracle: the corruption; a shift of 3 px and turns of about a degree."""
    left, right = demo()
    assert "rectified" in str(find_pair_fault(left, corrupt(right), KNOWN))


@pytest.mark.parametrize("px", [40, 60, -45])
def test_rows_that_are_far_off_are_no_other_scene(px: int) -> None:
    """Oracle: the corruption, a shift by more than a twentieth of the height."""
    left, right = demo()
    assert f"their corners lie {abs(px)}" in str(find_pair_fault(left, np.roll(right, px, 0), KNOWN))


@pytest.mark.parametrize("flip", [np.fliplr, np.flipud])
def test_a_mirrored_picture(flip) -> None:
    """Oracle: the corruption, of the right picture and of the left one (symmetric objects match all the same)."""
    left, right = demo()
    assert "mirrored" in str(find_pair_fault(left, flip(right), KNOWN))
    assert "mirrored" in str(find_pair_fault(flip(left), right, KNOWN))


@pytest.mark.parametrize(("turns", "degrees"), [(1, 90), (2, 180), (3, 90)])
def test_a_turned_picture(turns: int, degrees: int) -> None:
    """Oracle: the corruption."""
    left, right = demo()
    assert f"turned by {degrees} degrees" in str(find_pair_fault(left, np.rot90(right, turns), KNOWN))


def test_one_picture_twice_with_noise() -> None:
    """Oracle: the corruption: 3 levels of noise, as storing it anew may leave."""
    left, _ = demo()
    noise = np.random.default_rng(0).normal(0, 3, left.shape)
    assert "one and the same" in str(find_pair_fault(left, np.clip(left + noise, 0, 255).astype(np.uint8), KNOWN))


def test_pictures_of_different_scenes() -> None:
    """Oracle: the corruption: noise shares no corner with the left picture, and a flat one has none."""
    left, _ = demo()
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8).repeat(8, 0).repeat(8, 1)
    assert "same scene" in str(find_pair_fault(left, noise, KNOWN))
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
