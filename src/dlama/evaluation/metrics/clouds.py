"""An estimated and a true point cloud in -> distances between them and F-scores out, by a k-d tree.

As in Knapitsch et al., "Tanks and Temples" (2017): precision is the share of estimated points nearer than a threshold to
the truth, recall the share of true points nearer than it to the estimate, the F-score their harmonic mean.
"""

from __future__ import annotations

import math

import numpy as np

from dlama.errors import import_extra
from dlama.evaluation.metrics.pictures import SETTINGS
from dlama.geometry.camera import Float64Array


def cloud_scores(estimate: Float64Array, truth: Float64Array) -> dict[str, float]:
    """How far the estimate lies from the truth, how much of the truth it covers, and both in one.

    Args:
        estimate: N x 3, metres.
        truth: M x 3, metres.
    Returns:
        accuracy (metres, estimate to truth), completeness (metres, truth to estimate); per threshold fscore_0.02 (0..1).
        Where one cloud is empty, distances are nan and shares 0; where both are, there is nothing to score and all is nan.
    Raises:
        MissingExtraError: scipy is not installed.
    """
    there, back = nearest_distances(estimate, truth), nearest_distances(truth, estimate)
    scores = {"accuracy": _mean(there), "completeness": _mean(back)}
    for threshold in SETTINGS.cloud_thresholds_m:
        precision, recall = _share(there, threshold), _share(back, threshold)
        both = precision + recall
        scores[f"fscore_{threshold:.2f}"] = 2 * precision * recall / both if both > 0 else 0.0
    if len(estimate) + len(truth) == 0:
        return dict.fromkeys(scores, math.nan)
    return scores


def nearest_distances(points: Float64Array, others: Float64Array) -> Float64Array:
    """For each of N points the distance to the nearest of M others: N metres, inf where there are no others."""
    if len(points) == 0 or len(others) == 0:
        return np.full(len(points), np.inf)
    spatial = import_extra("scipy.spatial", "cloud metrics", "scipy", "evaluate")
    return np.asarray(spatial.cKDTree(others).query(points)[0], np.float64)


def _mean(distances: Float64Array) -> float:
    return float(distances.mean()) if len(distances) and np.isfinite(distances).all() else math.nan


def _share(distances: Float64Array, threshold: float) -> float:
    return float((distances < threshold).mean()) if len(distances) else 0.0
