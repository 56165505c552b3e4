"""Calibration and sparsification (oracles: closed forms and numbers worked out by hand)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.evaluation.metrics.reliability import (
    BINS,
    STEPS,
    by_distance,
    calibration,
    color_tolerance,
    sparsification_area,
)


def test_bins_by_hand() -> None:
    """Six pixels: two at 0.05 (one right), three at 0.95 (two right), one at exactly 1 (right)."""
    predicted = np.array([0.05, 0.05, 0.95, 0.95, 0.95, 1.0])
    bins = calibration(predicted, np.array([True, False, True, True, False, True]))
    assert bins.share[0] == pytest.approx(2 / 6) and bins.share[BINS - 1] == pytest.approx(4 / 6)
    assert bins.predicted[0] == pytest.approx(0.1 / 6) and bins.right[0] == pytest.approx(1 / 6)
    assert bins.error == pytest.approx(abs(0.1 - 1) / 6 + abs(0.95 * 3 + 1 - 3) / 6)
    assert bins.share.sum() == pytest.approx(1) and bins.share[1 : BINS - 1].sum() == 0


def test_what_is_right_as_often_as_it_says_is_calibrated() -> None:
    """Law: drawn with its own probability, the error is that of drawing; predicted twice as sure, it is the difference."""
    rng = np.random.default_rng(0)
    p = rng.random(200_000)
    assert calibration(p, rng.random(len(p)) < p).error < 0.01
    half = np.full(100_000, 0.8)
    assert calibration(half, rng.random(len(half)) < 0.4).error == pytest.approx(0.4, abs=0.01)


def test_the_area_is_that_of_a_literal_loop() -> None:
    """Slow twin: take away shares one by one and average what is left."""
    rng = np.random.default_rng(3)
    error, sure = rng.random(40), rng.random(40)
    gaps = []
    for share in STEPS:
        gone = int(share * 40)
        left = [sorted(range(40), key=lambda one: key[one])[gone:] for key in (sure, -error)]
        gaps.append((error[left[0]].mean() - error[left[1]].mean()) / error.mean())
    assert sparsification_area(sure, error) == pytest.approx(np.mean(gaps))


def test_the_formula_of_distance() -> None:
    """Closed form: 0.5 halved every 5 % of the diagonal (5 px of 100), more where the colour is measured."""
    hole = np.zeros((60, 80), bool)
    hole[:, 40:] = True
    found = by_distance(hole, hole)
    np.testing.assert_allclose(found[30, 45 - 1], 0.25, rtol=0.01)
    np.testing.assert_allclose(by_distance(hole, ~hole)[hole] / found[hole], 1.5)


def test_the_tolerance_is_what_two_cameras_agree_on() -> None:
    """Closed form: 25 where a seventh of the colours are 60 levels apart; 60 where a quarter are; 25 where hardly anything is
    seen by both."""
    mine = np.full((20, 20, 3), 100, np.uint8)
    both = np.ones((20, 20), bool)
    few, many = mine.copy(), mine.copy()
    few[:3] += 60
    many[:5] += 60
    assert color_tolerance(mine, mine, both, 25) == color_tolerance(mine, few, both, 25) == 25
    assert color_tolerance(mine, many, both, 25) == 60
    assert color_tolerance(mine, many, both & (np.arange(20) < 4)[:, None], 25) == 25
