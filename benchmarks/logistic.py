"""Features and outcomes in; the weights of a logistic regression out, by Newton's method."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NEWTON_STEPS = 30


def logistic_weights(features: NDArray[np.float64], right: NDArray[np.float64], ridge: float) -> NDArray[np.float64]:
    """F + 1 weights, the constant last, that make log odds of features: the least sum of log losses and ridge / 2 times squared
    weights (not the constant's).

    features: N x F, each of about unit spread. right: N, 0 or 1.
    """
    design = np.c_[features, np.ones(len(features))]
    costs = ridge * np.r_[np.ones(features.shape[1]), 1e-6]
    weights = np.zeros(design.shape[1])
    for _ in range(NEWTON_STEPS):
        predicted = 1 / (1 + np.exp(-design @ weights))
        curve = (design * (predicted * (1 - predicted))[:, None]).T @ design + np.diag(costs)
        weights -= np.linalg.solve(curve, design.T @ (predicted - right) + costs * weights)
    return weights
