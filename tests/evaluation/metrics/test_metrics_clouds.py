"""Cloud scores (oracle: all pairs compared one by one; grids whose distances are known)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dlama.evaluation.metrics.clouds import cloud_scores, nearest_distances
from reference.metrics_twin import nearest

NONE = np.zeros((0, 3))


def test_scores_are_those_of_all_pairs_compared() -> None:
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
        wanted = 2 * precision * recall / (precision + recall) if precision + recall else 0
        assert got[f"fscore_{name}"] == pytest.approx(wanted)
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
    for got in (cloud_scores(NONE, one), cloud_scores(one, NONE)):
        assert all(math.isnan(got[name]) for name in ("accuracy", "completeness"))
        assert got["fscore_0.05"] == 0
    assert all(math.isnan(value) for value in cloud_scores(NONE, NONE).values())
