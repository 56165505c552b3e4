"""The logistic regression against what its minimum must fulfil."""

from __future__ import annotations

import numpy as np
import pytest

from shadow_classifier import logistic_weights


def test_no_other_weights_are_better() -> None:
    """Oracle: at the minimum the loss, written out, has no slope, and it rises in every direction."""
    rng = np.random.default_rng(0)
    features = rng.normal(size=(300, 4))
    right = (rng.random(300) < 1 / (1 + np.exp(-(features @ [1.0, -2.0, 0.0, 0.5] - 0.7)))).astype(np.float64)

    def loss(weights: np.ndarray) -> float:
        odds = features @ weights[:-1] + weights[-1]
        return float(np.log1p(np.exp(-np.where(right > 0, odds, -odds))).sum() + 1.5 * (weights[:-1] ** 2).sum())

    weights = logistic_weights(features, right, ridge=3.0)
    least = loss(weights)
    for step in 0.01 * np.concatenate([np.eye(5), -np.eye(5)]):
        assert loss(weights + step) > least
        assert (loss(weights + step) - loss(weights - step)) / 0.02 == pytest.approx(0, abs=0.02)


def test_what_nothing_speaks_for_gets_the_mean() -> None:
    """Closed form: features of no use have no weight, and the constant gives the log odds of the mean."""
    right = np.r_[np.ones(30), np.zeros(70)]
    assert logistic_weights(np.zeros((100, 2)), right, ridge=1.0) == pytest.approx([0, 0, np.log(0.3 / 0.7)], abs=1e-6)
