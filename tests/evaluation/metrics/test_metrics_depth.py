"""Depth errors (oracle: closed forms, counted by hand)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dlama.evaluation.metrics.depth import depth_errors

FAR, MISSING = np.inf, 0.0


def row(*metres: float) -> np.ndarray:
    """1 x N, float32."""
    return np.array([metres], np.float32)


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
