"""Disparity errors and left-right consistency (oracle: hand-counted rows, a literal twin, a pair made by shifting)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dlama.evaluation.metrics.depth import disparity_errors, left_right_difference, visible_in_right
from reference.metrics_twin import left_right


def row(*pixels: float) -> np.ndarray:
    """1 x N, float32."""
    return np.array([pixels], np.float32)


def test_errors_by_hand() -> None:
    """Errors 0, 1, 1.5, 3, missing, and one pixel without truth: the limit itself is not bad, missing is."""
    got = disparity_errors(row(10, 11, 8.5, 13, 0, 9), row(10, 10, 10, 10, 10, np.inf))
    assert got["bad-1"] == pytest.approx(3 / 5)
    assert got["bad-2"] == pytest.approx(2 / 5)
    assert got["epe"] == pytest.approx((0 + 1 + 1.5 + 3) / 4)
    assert got["coverage"] == pytest.approx(4 / 5)


def test_only_the_region_counts_and_an_empty_one_is_nan() -> None:
    """By hand."""
    got = disparity_errors(row(5, 90), row(5, 5), np.array([[True, False]]))
    assert (got["bad-1"], got["epe"], got["coverage"]) == (0, 0, 1)
    nothing = disparity_errors(row(5, 90), row(5, 5), np.zeros((1, 2), np.bool_))
    assert len(nothing) == 4 and all(math.isnan(value) for value in nothing.values())


def shifted_pair() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A wall at 3 px and a box at 8 px before it; the right picture is painted from both, nearest last."""
    rng = np.random.default_rng(5)
    left = rng.integers(0, 256, (12, 40, 3), np.uint8)
    disparity = np.full((12, 40), 3, np.float32)
    disparity[3:9, 15:25] = 8
    right = rng.integers(0, 256, left.shape, np.uint8)
    right[:, :37] = left[:, 3:]
    right[3:9, 7:17] = left[3:9, 15:25]
    return left, right, disparity


def test_a_true_pair_is_consistent_where_both_see() -> None:
    """Closed form: 0 levels; hidden are the wall's columns 10..14 beside the box and what leaves the picture."""
    left, right, disparity = shifted_pair()
    assert left_right_difference(left, right, disparity) == 0
    hidden = np.zeros(disparity.shape, np.bool_)
    hidden[:, :3] = True
    hidden[3:9, 10:15] = True
    np.testing.assert_array_equal(visible_in_right(disparity), ~hidden)


def test_a_known_difference_is_measured() -> None:
    """Closed form: the right picture 7 levels brighter; in a region only, and nan where nothing is left."""
    left, right, disparity = shifted_pair()
    left, right = left // 2, right // 2 + 7
    assert left_right_difference(left, right, disparity) == 7
    right[:6] += 10
    top = np.zeros(disparity.shape, np.bool_)
    top[:6] = True
    assert left_right_difference(left, right, disparity, top) == 17
    assert math.isnan(left_right_difference(left, right, np.zeros_like(disparity)))


@pytest.mark.parametrize("colour", [True, False])
def test_any_disparity_agrees_with_the_twin(colour: bool) -> None:
    """Literal twin: fractions, holes, occlusions, values that leave the picture."""
    rng = np.random.default_rng(6)
    left, right = rng.integers(0, 256, (2, 9, 30, *[3] * colour), np.uint8)
    disparity = rng.uniform(-2, 12, (9, 30)).astype(np.float32)
    disparity[:, 20] = np.inf
    disparity[disparity < 0] = 0
    assert 0.2 < visible_in_right(disparity).mean() < 0.7
    assert left_right_difference(left, right, disparity) == pytest.approx(left_right(left, right, disparity))
