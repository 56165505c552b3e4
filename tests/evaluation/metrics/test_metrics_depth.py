"""Depth, disparity, left-right consistency, clouds (oracles: counted by hand, literal twins, a pair made by shifting, grids)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dlama.evaluation.metrics.depth import (
    cloud_scores,
    depth_errors,
    disparity_errors,
    left_right_difference,
    nearest_distances,
    visible_in_right,
)
from reference.metrics_twin import left_right, nearest

FAR, MISSING = np.inf, 0.0
NO_POINTS = np.zeros((0, 3))


def row(*values: float) -> np.ndarray:
    """1 x N, float32."""
    return np.array([values], np.float32)


def test_every_rule_once_by_hand() -> None:
    """Truth 2, 4, 20, far, far, missing, 8, 5, NaN m; mine 2, 4.5, 15, far, 9, 3, missing, far, 1 m."""
    truth = row(2, 4, 20, FAR, FAR, MISSING, 8, 5, np.nan)
    mine = row(2, 4.5, 15, FAR, 9, 3, MISSING, FAR, 1)
    got = depth_errors(mine, truth)
    # cut at 10 m: 2-2, 4.5-4, 10-10, 10-10, 9-10, (truth missing), missing counts as 10: 10-8, far is 10: 10-5
    assert got["mae"] == pytest.approx((0 + 0.5 + 0 + 0 + 1 + 2 + 5) / 7)
    assert got["rmse"] == pytest.approx(math.sqrt((0.25 + 1 + 4 + 25) / 7))
    # valid on both sides: the first three, in full metres
    assert got["absrel"] == pytest.approx((0 + 0.125 + 0.25) / 3)
    # ratios 1, 1.125, 1.333, wrong (missing), wrong (far)
    assert got["delta1.05"] == pytest.approx(1 / 5)
    assert got["delta1.25"] == pytest.approx(2 / 5)
    assert got["coverage"] == pytest.approx(3 / 5)


def test_the_ratio_counts_both_ways() -> None:
    """Half and double are equally wrong; the limit itself is not within."""
    assert depth_errors(row(2, 1), row(1, 2))["delta1.25"] == 0
    assert depth_errors(row(1.25), row(1))["delta1.25"] == 0


def test_only_the_region_counts() -> None:
    """By hand: the wrong pixel is outside."""
    got = depth_errors(row(1, 9), row(1, 2), np.array([[True, False]]))
    assert got["mae"] == got["absrel"] == 0


@pytest.mark.parametrize("truth", [row(MISSING, np.nan), row(1, 1)])
def test_nothing_to_count_is_nan(truth: np.ndarray) -> None:
    """An unknown truth, or an empty region."""
    got = depth_errors(row(1, 1), truth, np.zeros((1, 2), np.bool_) if truth[0, 0] else None)
    assert len(got) == 6
    assert all(math.isnan(value) for value in got.values())


def test_sky_alone_has_mae_and_no_absrel() -> None:
    """Far truth, far estimate: 0 m at the cut, and nothing validly true."""
    got = depth_errors(row(FAR), row(FAR))
    assert got["mae"] == 0
    assert math.isnan(got["absrel"]) and math.isnan(got["delta1.05"])


def test_disparity_errors_by_hand() -> None:
    """Errors 0, 1, 1.5, 3, missing, and one pixel without truth: the limit itself is not bad, missing is. Below 0, as of sky in a
    rig with doffs, it is an estimate; it counted as missing."""
    got = disparity_errors(row(10, 11, 8.5, 13, 0, 9), row(10, 10, 10, 10, 10, np.inf))
    assert got["bad-1"] == pytest.approx(3 / 5)
    assert got["bad-2"] == pytest.approx(2 / 5)
    assert got["epe"] == pytest.approx((0 + 1 + 1.5 + 3) / 4)
    assert got["coverage"] == pytest.approx(4 / 5)
    assert disparity_errors(row(-20), row(5)) == {"bad-1": 1, "bad-2": 1, "epe": 25, "coverage": 1}


def test_disparity_of_a_region_and_of_an_empty_one() -> None:
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
    """Closed form: 0 levels; hidden are the wall's columns 10..14 next to the box and what leaves the picture."""
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
    """Literal twin: fractions, signs, holes, occlusions, values that leave the picture."""
    rng = np.random.default_rng(6)
    left, right = rng.integers(0, 256, (2, 9, 30, *[3] * colour), np.uint8)
    disparity = rng.uniform(-2, 12, (9, 30)).astype(np.float32)
    disparity[:, 20] = np.inf
    disparity[:, 7] = 0
    assert 0.2 < visible_in_right(disparity).mean() < 0.7
    assert left_right_difference(left, right, disparity) == pytest.approx(left_right(left, right, disparity))


def test_cloud_scores_are_those_of_all_pairs_compared() -> None:
    """Twin: brute force on two random clouds."""
    rng = np.random.default_rng(1)
    estimate, truth = rng.uniform(0, 0.5, (120, 3)), rng.uniform(0, 0.5, (170, 3))
    there, back = nearest(estimate, truth), nearest(truth, estimate)
    np.testing.assert_allclose(nearest_distances(estimate, truth), there, atol=1e-12)
    got = cloud_scores(estimate, truth)
    assert got["accuracy"] == pytest.approx(there.mean())
    assert got["completeness"] == pytest.approx(back.mean())
    for name, limit in (("0.02", 0.02), ("0.05", 0.05), ("0.10", 0.1)):
        precision, recall = (there < limit).mean(), (back < limit).mean()
        expected = 2 * precision * recall / (precision + recall) if precision + recall else 0
        assert got[f"fscore_{name}"] == pytest.approx(expected)
    assert 0 < got["fscore_0.05"] < got["fscore_0.10"] < 1


def test_half_a_wall_lifted_by_3_cm() -> None:
    """Closed form: a metre grid at 10 cm; the estimate has its left half only, 3 cm before it."""
    grid = np.stack([*np.mgrid[:10, :10] / 10, np.zeros((10, 10))], axis=-1).reshape(-1, 3)
    estimate = grid[grid[:, 0] < 0.45] + [0, 0, 0.03]
    got = cloud_scores(estimate, grid)
    assert got["accuracy"] == pytest.approx(0.03)
    # true points of the right half reach back 10, 20, .. 50 cm and 3 cm across
    across = [math.hypot(step / 10, 0.03) for step in (1, 2, 3, 4, 5)]
    assert got["completeness"] == pytest.approx((5 * 0.03 + sum(across)) / 10)
    assert got["fscore_0.02"] == 0
    assert got["fscore_0.05"] == pytest.approx(2 / 3)


def test_the_threshold_itself_is_not_within() -> None:
    """Knapitsch et al. 2017: distance < threshold."""
    got = cloud_scores(np.array([[0.0, 0, 0.05]]), np.zeros((1, 3)))
    assert (got["fscore_0.05"], got["fscore_0.10"]) == (0, 1)


def test_empty_clouds() -> None:
    """Nothing estimated, or nothing there to estimate: no distance, no share right; both: nothing to score."""
    one = np.zeros((1, 3))
    for got in (cloud_scores(NO_POINTS, one), cloud_scores(one, NO_POINTS)):
        assert all(math.isnan(got[name]) for name in ("accuracy", "completeness"))
        assert got["fscore_0.05"] == 0
    assert all(math.isnan(value) for value in cloud_scores(NO_POINTS, NO_POINTS).values())
