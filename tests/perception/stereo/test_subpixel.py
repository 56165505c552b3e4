"""Disparities refined below a pixel: oracle is a texture that is drawn with the disparity of a slanted plane."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.perception.stereo import subpixel
from dlama.perception.stereo.subpixel import LARGEST_MOVE_PX, refine_disparity

ROWS, COLUMNS = 120, 200


def slanted_pair() -> tuple[UInt8Array, UInt8Array, Float32Array]:
    """Left and right picture of a slanted plane, and its disparity in the left one: that is the right one, resampled."""
    noise = np.random.default_rng(0).integers(0, 256, (ROWS, COLUMNS, 3)).astype(np.uint8)
    right = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 1.5), None, 0, 255, cv2.NORM_MINMAX)
    row, column = np.mgrid[:ROWS, :COLUMNS].astype(np.float32)
    disparity = (6 + 0.02 * column + 0.01 * row).astype(np.float32)
    left = cv2.remap(right, column - disparity, row, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    return left, right, disparity


def matched_coarsely(disparity: Float32Array) -> Float32Array:
    """As a matcher gives it: pulled to whole pixels, with a hole."""
    found = disparity - 0.25 * np.sin(2 * np.pi * disparity)
    found[30:50, 60:90] = np.nan
    return found.astype(np.float32)


def test_waves_between_whole_disparities_go() -> None:
    """Less than half of their error is left; what is unknown stays so."""
    left, right, disparity = slanted_pair()
    found = matched_coarsely(disparity)
    refined = refine_disparity(left, right, found, 0)
    assert np.array_equal(np.isnan(refined), np.isnan(found))
    before, after = (np.nanmean(np.abs(one - disparity)[8:-8, 30:-8]) for one in (found, refined))
    assert before > 0.15
    assert after < before / 2


def test_no_match_moves_farther_than_half_a_pixel() -> None:
    """Pictures that show nothing alike may not carry matches off, nor below the least that is sought."""
    left, right, disparity = slanted_pair()
    step = np.where(np.arange(COLUMNS) < 100, disparity, disparity + 12).astype(np.float32)
    refined = refine_disparity(left[::-1].copy(), right, step, 6.0)
    assert refined.min() >= 6
    assert np.abs(refined - step).max() <= LARGEST_MOVE_PX + 0.1  # the bilateral filter's


def test_bands_leave_no_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the same picture in one band."""
    left, right, disparity = slanted_pair()
    found = matched_coarsely(disparity)
    whole = refine_disparity(left, right, found, 0)
    monkeypatch.setattr(subpixel, "BAND_ROWS", 40)
    apart = np.abs(refine_disparity(left, right, found, 0) - whole)
    assert np.nanmax(apart) < 0.005


def test_nothing_known_stays_unknown() -> None:
    left, right, disparity = slanted_pair()
    assert np.isnan(refine_disparity(left, right, np.full_like(disparity, np.nan), 0)).all()
