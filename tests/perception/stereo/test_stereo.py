"""Stereo matching against pairs rendered in closed form, laws of symmetry, and Middlebury's measured disparities."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

import dlama
from dlama.errors import InputError, MaskError
from dlama.perception.stereo import matching as stereo_matching
from dlama.perception.stereo.agreement import consistency, transfer_mask
from dlama.perception.stereo.matching import disparity_pair, equalise_exposure
from marks import first_quick

HEIGHT, WIDTH = 90, 160
Array = np.ndarray


def texture(x: Array, y: Array, seed: int) -> Array:
    """A smooth random pattern with a value at every real (x, y), so that any sub-pixel shift of it is exact."""
    rng = np.random.default_rng(seed)
    waves = rng.uniform(-1.1, 1.1, (24, 2))
    phases = rng.uniform(0, 2 * np.pi, (24, 3))
    level = sum(np.sin(wx * x + wy * y)[..., None] * np.cos(p) + np.cos(wx * x + wy * y)[..., None] * np.sin(p)
                for (wx, wy), p in zip(waves, phases))  # fmt: skip
    return np.clip(np.rint(127 + 22 * level), 0, 255).astype(np.uint8)


def pixel_grid() -> tuple[Array, Array]:
    return np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))


def plane_pair(a: float, b: float, c: float) -> tuple[Array, Array, Array, Array]:
    """Left, right and both true disparities of the textured plane whose left disparity is a + b x + c y."""
    x, y = pixel_grid()
    source = (x + a + c * y) / (1 - b)  # solves x_right = x_left - d(x_left)
    return texture(x, y, 1), texture(source, y, 1), a + b * x + c * y, source - x


NEAR, BACK = 21.3, 6.5
SQUARE = (slice(25, 65), slice(60, 110))


def square_before_wall() -> tuple[Array, Array, Array]:
    """Left, right and left disparity: a square (SQUARE in the left view) at 21.3 px before a wall at 6.5 px."""
    x, y = pixel_grid()

    def inside(column: Array) -> Array:
        return (column >= 59.5) & (column < 109.5) & (y >= 25) & (y < 65)

    left = np.where(inside(x)[..., None], texture(x, y, 2), texture(x, y, 3))
    right = np.where(inside(x + NEAR)[..., None], texture(x + NEAR, y, 2), texture(x + BACK, y, 3))
    return left, right, np.where(inside(x), NEAR, BACK)


@pytest.mark.parametrize("a, b, c", [(7.3, 0, 0), (12.75, 0, 0), (6, 0.06, 0.03), (20, -0.05, 0)])
def test_planes_of_known_subpixel_disparity(a: float, b: float, c: float) -> None:
    """Closed form: a textured plane, fronto-parallel or slanted, in both views."""
    left, right, *truths = plane_pair(a, b, c)
    for found, truth in zip(disparity_pair(left, right), truths):
        known = found != 0
        error = np.abs(found - truth)[known]
        assert found.dtype == np.float32 and known.mean() > 0.8
        assert np.median(error) < 0.2 and np.percentile(error, 99) < 0.6  # whole pixels: up to 0.3 in the median


def test_large_pictures_are_searched_at_half_the_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Closed form: with little room for eight paths they are followed in smaller pictures; the finer search says the rest."""
    left, right, truth, _ = plane_pair(12.75, 0, 0)
    monkeypatch.setattr(stereo_matching, "VOLUME", 3e4)
    assert stereo_matching._scale_of_whole(left.shape, 30) == 0.25
    found, _ = disparity_pair(left, right, max_disparity=30)
    error = np.abs(found - truth)[found != 0]
    assert (found != 0).mean() > 0.7 and np.median(error) < 0.2 and np.percentile(error, 98) < 1


@pytest.mark.parametrize("width", [160, 157])
def test_wide_pictures_are_halved_and_their_matches_refined(monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    """Closed form: a slanted plane matched at a half and at a quarter of its width, odd ones too, is right below a pixel."""
    left, right, truth, _ = plane_pair(16, 0.06, 0.03)
    smooth = [cv2.GaussianBlur(picture, (0, 0), 2)[:, :width] for picture in (left, right)]
    monkeypatch.setattr(stereo_matching, "WIDEST_PX", 50)
    found, _ = disparity_pair(smooth[0], smooth[1], max_disparity=40)
    error = np.abs(found - truth[:, :width])[found != 0]
    assert (found != 0).mean() > 0.8 and np.median(error) < 0.1 and np.percentile(error, 95) < 0.6


def test_columns_near_the_left_border_are_matched() -> None:
    """Law: with a search 64 px wide, only the columns whose match leaves the picture (12.75 px) are unknown."""
    left, right, *_ = plane_pair(12.75, 0, 0)
    at_left, at_right = disparity_pair(left, right, max_disparity=64)
    assert (at_left[:, 16:60] != 0).mean() > 0.97
    assert (at_left[:, :11] == 0).all()
    assert (at_right[:, WIDTH - 60 : WIDTH - 16] != 0).mean() > 0.97
    assert (at_right[:, WIDTH - 11 :] == 0).all()


@pytest.mark.slow
def test_exposure_hardly_costs_matches() -> None:
    """Law: a right picture of another exposure matches as the same one of equal exposure does (97 % of it)."""
    left, right = (dlama.read_color(dlama.example() / name) for name in ("street.jpg", "right.jpg"))
    alike, *others = (
        disparity_pair(left, np.clip(right * times, 0, 255).astype(np.uint8), max_disparity=40)[0]
        for times in (1.0, 0.3, 1.4)
    )
    for unlike in others:
        both = (alike != 0) & (unlike != 0)
        assert both.sum() > 0.97 * (alike != 0).sum()
        assert np.median(np.abs(alike - unlike)[both]) < 0.1


def test_pictures_that_are_about_as_bright_stay_bit_for_bit() -> None:
    """Law: up to a tenth nothing is changed; beyond it the mean is the other picture's."""
    rng = np.random.default_rng(0)
    picture = rng.integers(20, 160, (40, 50, 3), np.uint8)
    assert equalise_exposure(picture, (picture * 1.08).astype(np.uint8)) is picture
    assert abs(equalise_exposure(picture, (picture * 0.5).astype(np.uint8)).mean() - picture.mean() / 2) < 0.7


def test_mirrored_pair_gives_mirrored_disparities() -> None:
    """Law: mirrored left to right, the right view is the left one of the pair; so are the disparities, but for rounding."""
    left, right, _ = square_before_wall()
    at_left, at_right = disparity_pair(left, right, max_disparity=32)
    mirrored_left, mirrored_right = disparity_pair(right[:, ::-1], left[:, ::-1], max_disparity=32)
    for mirrored, found in ((mirrored_left, at_right), (mirrored_right, at_left)):
        apart = np.abs(mirrored - found[:, ::-1])  # doubling the width rounds grey levels, which moves a few
        assert (apart > 1 / 32).mean() < 0.002 and np.percentile(apart, 99.9) < 0.2


def test_what_one_camera_sees_alone_is_unknown() -> None:
    """Closed form: left of a near square, NEAR - BACK columns of the wall are hidden from the right camera."""
    left, right, truth = square_before_wall()
    at_left, at_right = disparity_pair(left, right)
    hidden = at_left[27:63, 60 - 13 : 60 - 2]
    assert (hidden != 0).mean() < 0.15
    seen_alone_by_right = at_right[27:63, 110 - 21 + 2 : 110 - 21 + 13]
    assert (seen_alone_by_right != 0).mean() < 0.15
    error = np.abs(at_left - truth)[at_left != 0]
    assert (error < 0.5).mean() > 0.95 and (at_left[28:62, 63:107] != 0).mean() > 0.97


def test_the_range_is_obeyed_and_may_be_negative() -> None:
    """Closed form: a shift of -5.25 px is found where the range has it; outside the range nothing is ever reported."""
    left, right, *_ = plane_pair(-5.25, 0, 0)
    found, _ = disparity_pair(left, right, min_disparity=-10)
    assert abs(np.median(found[found != 0]) + 5.25) < 0.1 and (found != 0).mean() > 0.8
    chance, _ = disparity_pair(left, right, min_disparity=3, max_disparity=16)
    assert (chance != 0).mean() < 0.5 < (found != 0).mean()
    assert ((chance == 0) | ((chance >= 3) & (chance <= 16))).all()


def test_infinity_is_not_lost_as_unknown() -> None:
    """Law: two equal pictures show a world at infinity; its disparity is known, tiny and never negative."""
    picture = texture(*pixel_grid(), 4)
    for found in disparity_pair(picture, picture):
        assert (found > 0).mean() > 0.95 and (found >= 0).all() and np.median(found) < 0.1


@pytest.mark.parametrize("hw", [(1, 1), (1, 9), (9, 1), (2, 3)])
def test_tiny_pictures_do_not_crash(hw: tuple[int, int]) -> None:
    """Law: a picture too small to be matched gives maps of its size, finite and without negative values."""
    picture = np.random.default_rng(0).integers(0, 256, (*hw, 3), np.uint8)
    for found in disparity_pair(picture, picture):
        assert found.shape == hw and np.isfinite(found).all() and (found >= 0).all()


def test_noise_hardly_matches() -> None:
    """Law: unrelated pictures agree on nothing but chance."""
    rng = np.random.default_rng(5)
    left, right = rng.integers(0, 256, (2, HEIGHT, WIDTH, 3), np.uint8)
    for found in disparity_pair(left, right, max_disparity=48):
        assert (found != 0).mean() < 0.2


def test_a_range_that_is_empty_or_too_large_is_refused() -> None:
    """Law: 16 bits in steps of 1/16 hold 2000 px; pictures are searched at twice the width up to 1600 px, halved from 2400 on."""
    for width, most in ((1600, 1000), (1700, 1700), (2400, 2000), (2401, 2000), (3600, 3600), (6000, 4000)):
        picture = np.zeros((1, width, 3), np.uint8)
        with pytest.raises(InputError, match=f"at most {most} px is expected"):
            disparity_pair(picture, picture, max_disparity=most + 1)
    with pytest.raises(InputError, match="max_disparity is 3 px; more than 5 px is expected"):
        disparity_pair(picture, picture, min_disparity=5, max_disparity=3)


def test_consistency_counts_what_its_docstring_says() -> None:
    """Closed form, worked by hand: a 1 x 4 pair, true shift 1 px, one unknown pixel, one wrong right disparity."""
    left = np.array([[10, 20, 30, 40]], np.uint8)[..., None].repeat(3, 2)
    right = np.array([[20, 33, 40, 0]], np.uint8)[..., None].repeat(3, 2)
    at_left = np.array([[1, 1, 1, np.nan]], np.float32)  # the first lands outside, the last is unknown
    at_right = np.array([[1, 9, 0, 0]], np.float32)
    score = consistency(left, right, at_left, at_right)
    assert (score.photometric_mae, score.left_right_within_1px, score.coverage) == (1.5, 0.5, 0.75)
    half = consistency(left, left, np.full((1, 4), 0.5, np.float32), at_right)
    assert half.photometric_mae == 5  # between two columns that differ by 10
    none = consistency(left, right, np.zeros((1, 4), np.float32), at_right)
    assert np.isnan(none.photometric_mae) and np.isnan(none.left_right_within_1px) and none.coverage == 0


def test_carried_mask_of_a_square() -> None:
    """Closed form: the near square's mask lies NEAR px farther left in the right view, also with holes in its depth."""
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[SQUARE] = True
    disparity = np.where(mask, NEAR, BACK).astype(np.float32)
    disparity[30:50, 60:75] = 0  # unknown inside the mask
    disparity[40, :] = np.nan
    expected = np.zeros_like(mask)
    expected[25:65, 60 - 21 : 110 - 21] = True
    np.testing.assert_array_equal(transfer_mask(mask, disparity), expected)


def test_carried_mask_has_no_cracks_on_a_slant() -> None:
    """Law: disparity that grows to the left stretches the mask in the right view; the stretch leaves no gaps."""
    mask = np.zeros((20, 60), bool)
    mask[5:15, 20:50] = True
    disparity = np.broadcast_to(20 - 0.4 * np.arange(60, dtype=np.float32), mask.shape)
    carried = transfer_mask(mask, disparity)
    columns = np.nonzero(carried[10])[0]
    assert (columns[0], columns[-1]) == (8, 49) and carried[5:15, 8:50].all() and carried.sum() == 10 * 42


def test_masks_that_cannot_be_carried() -> None:
    """Oracle: an empty mask stays empty, one that leaves the picture too; no disparity is an error."""
    mask = np.zeros((4, 6), bool)
    disparity = np.full((4, 6), 5, np.float32)
    assert not transfer_mask(mask, disparity).any()
    mask[1:3, 1:4] = True
    assert not transfer_mask(mask, disparity).any()
    with pytest.raises(MaskError, match="no disparity is known inside the mask"):
        transfer_mask(mask, np.zeros((4, 6), np.float32))


def middlebury(data_dir: Path, name: str) -> tuple[Array, Array, list[Array]]:
    """Left, right, true left and (where published) right disparity; 0 = unknown."""
    if name == "motorcycle":
        folder = data_dir / "data/motorcycle"
        with np.load(folder / "disparity.npz") as reported:
            truths = [np.nan_to_num(reported["disparity"], posinf=0)]
    else:
        folder = data_dir / "data/stereo" / name
        scale = json.loads((folder / "calib.json").read_text())["disparity_scale"]
        truths = [np.array(Image.open(folder / f"disp_{side}.png")) / scale for side in ("left", "right")]
    return dlama.read_color(folder / "left.png"), dlama.read_color(folder / "right.png"), truths


@pytest.mark.parametrize("name, most_bad_1, most_epe", first_quick([("cone", 0.07, 0.6), ("motorcycle", 0.08, 0.9)]))
def test_middlebury_pairs(
    data_dir: Path, name: str, most_bad_1: float, most_epe: float, record_property: Callable[[str, object], None]
) -> None:
    """Oracle: Middlebury's measured disparities. Bounds are about 1.6 times what was measured when this was written."""
    left, right, truths = middlebury(data_dir, name)
    found = disparity_pair(left, right)
    for side, disparity, truth in zip(("left", "right"), found, truths):
        both = (disparity != 0) & (truth > 0)
        error = np.abs(disparity - truth)[both]
        score = {"bad-1": (error > 1).mean(), "bad-2": (error > 2).mean(), "EPE": error.mean()}
        score["coverage"] = both.sum() / (truth > 0).sum()
        record_property(f"{name} {side}", {key: round(float(value), 4) for key, value in score.items()})
        assert score["bad-1"] < most_bad_1 and score["EPE"] < most_epe and score["coverage"] > 0.82
    agreement = consistency(left, right, *found)
    assert agreement.left_right_within_1px > 0.99 and agreement.photometric_mae < 9


@pytest.mark.parametrize("name, mae, within", [("cone", 8.768, 0.947), ("Cloth3", 3.980, 0.975)])
def test_consistency_of_the_true_disparities(data_dir: Path, name: str, mae: float, within: float) -> None:
    """Oracle: somebody else's code; the numbers published next to the pairs (calib.json, "measured")."""
    left, right, truths = middlebury(data_dir, name)
    score = consistency(left, right, *(truth.astype(np.float32) for truth in truths))
    assert abs(score.photometric_mae - mae) < 0.01
    assert abs(score.left_right_within_1px - within) < 0.002
