"""SSIM, MSE, PSNR, region means, 8-bit depth and gain (oracles: scikit-image, hand)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from skimage.metrics import mean_squared_error, peak_signal_noise_ratio, structural_similarity

from dlama.errors import ShapeError
from dlama.evaluation.metrics.pictures import (
    channel_gain,
    depth_8bit,
    mse_map,
    psnr,
    region_mean,
    ssim_map,
)
from dlama.evaluation.protocols.scores import region_ssim

RNG = np.random.default_rng(3)
TRUTH = RNG.integers(0, 256, (20, 31, 3), np.uint8)
MINE = np.clip(TRUTH + RNG.normal(0, 30, TRUTH.shape), 0, 255).astype(np.uint8)


def test_whole_ssim_is_scikit_images_own_number() -> None:
    """Somebody else's code, called as everybody calls it: uint8, its defaults, data_range and channel_axis."""
    theirs = structural_similarity(TRUTH, MINE, data_range=255, channel_axis=2)
    assert region_ssim(ssim_map(TRUTH, MINE), None) == pytest.approx(theirs, abs=1e-12)
    plane = structural_similarity(TRUTH[..., 1], MINE[..., 1], data_range=255)
    assert region_ssim(ssim_map(TRUTH[..., 1], MINE[..., 1]), None) == pytest.approx(plane, abs=1e-12)


def test_mse_and_psnr_are_scikit_images() -> None:
    """Somebody else's code; and 100 levels of one channel of three, by hand."""
    mse = region_mean(mse_map(TRUTH, MINE))
    assert mse == pytest.approx(mean_squared_error(TRUTH, MINE), rel=1e-12)
    assert psnr(mse) == pytest.approx(peak_signal_noise_ratio(TRUTH, MINE), rel=1e-12)
    black, red = np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2, 3), np.uint8)
    red[0, 0, 0] = 100
    np.testing.assert_allclose(mse_map(black, red), [[10000 / 3, 0], [0, 0]])


def test_psnr_by_hand() -> None:
    """The peak itself as error is 0 dB, a hundredth of it 40 dB; none at all is inf, nothing measured is nan."""
    assert psnr(255.0**2) == 0
    assert psnr(2.55**2) == pytest.approx(40)
    assert psnr(0.0) == math.inf
    assert math.isnan(psnr(math.nan))


def test_region_mean_by_hand() -> None:
    """Only the region counts; an empty one is nan; None is everywhere."""
    values = np.array([[1.0, 2.0], [3.0, 10.0]])
    assert region_mean(values, np.array([[True, False], [True, False]])) == 2
    assert region_mean(values) == 4
    assert math.isnan(region_mean(values, np.zeros((2, 2), np.bool_)))


def test_depth_8bit_by_hand() -> None:
    """0..10 m are 0..255, rounded; far and beyond are 255, missing is 0."""
    depth = np.array([[0, np.nan, 0.02, 0.0197, 5.0, 9.99, 10.0, 80.0, np.inf]], np.float32)
    # 0.02 m is 0.51 levels, 0.0197 m is 0.502, 5 m is 127.5 (ties to the even), 9.99 m is 254.745
    np.testing.assert_array_equal(depth_8bit(depth), [[0, 0, 1, 1, 128, 255, 255, 255, 255]])
    assert depth_8bit(depth).dtype == np.uint8


def test_gain_is_found_though_a_third_of_the_pixels_do_not_match() -> None:
    """Closed form: exposure 1.25, 0.8, 1 with noise on both sides; a third of the frame shows something else."""
    scene = RNG.uniform(40, 180, (60, 80, 3))
    mine = np.clip(scene + RNG.normal(0, 6, scene.shape), 0, 255)
    truth = np.clip(scene * [1.25, 0.8, 1.0] + RNG.normal(0, 6, scene.shape), 0, 255)
    truth[:20] = RNG.uniform(0, 255, (20, 80, 3))
    everywhere = np.ones((60, 80), np.bool_)
    found = channel_gain(mine.astype(np.uint8), truth.astype(np.uint8), everywhere)
    np.testing.assert_allclose(found, [1.25, 0.8, 1.0], rtol=0.02)
    assert not np.allclose(truth.mean((0, 1)) / mine.mean((0, 1)), [1.25, 0.8, 1.0], rtol=0.02)


def test_gain_of_equal_pictures_is_one_and_so_is_that_of_too_few_pixels() -> None:
    """Law; and 99 pixels, or none between black and white, say nothing."""
    everywhere = np.ones(TRUTH.shape[:2], np.bool_)
    assert channel_gain(TRUTH, TRUTH, everywhere) == (1.0, 1.0, 1.0)
    few = np.zeros(TRUTH.shape[:2], np.bool_)
    few.ravel()[:99] = True
    assert channel_gain(TRUTH, MINE, few) == (1.0, 1.0, 1.0)
    white = np.full_like(TRUTH, 255)
    assert channel_gain(white, TRUTH, everywhere) == (1.0, 1.0, 1.0)


def test_small_pictures_are_refused() -> None:
    """What came and what was expected."""
    with pytest.raises(ShapeError, match="31x6; SSIM needs 7 pixels or more"):
        ssim_map(TRUTH[:6], MINE[:6])
