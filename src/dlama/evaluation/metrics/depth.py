"""An estimate of depth, disparity or a point cloud and its truth in -> errors and shares of what is right out.

Every true pixel is valid (finite, > 0), far (inf) or missing (0, NaN); where the truth is missing nothing is counted.
Two rules then, because sky has no metres:

- `mae` and `rmse` count every pixel whose truth is valid or far, both depths cut at the paper's clip: sky is there, and so
  is an estimate that is far or missing.
- `absrel` counts the pixels where truth and estimate are both valid;
  `coverage` is their share of the validly true pixels. `delta*` counts all validly true pixels, and an estimate that
  is far or missing is wrong there.

Disparity is in pixels: what the left picture shows in column x, the right shows in column x - d of the same row. 0, NaN
and inf = missing.
"""

from __future__ import annotations

import math

import numpy as np

from dlama.errors import import_extra
from dlama.evaluation.metrics.pictures import SETTINGS, mean_or_nan
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array


def depth_errors(mine: Float32Array, truth: Float32Array, region: BoolArray | None = None) -> dict[str, float]:
    """Depth errors over a region; the rules stand at the top of the file.

    Args:
        mine: H x W metres; 0 or NaN = missing, inf = far.
        truth: likewise.
        region: H x W; None = everywhere.
    Returns:
        mae, rmse (metres), absrel, delta1.05, delta1.25, coverage (0..1); nan where no pixel
        counts.
    """
    chosen = slice(None) if region is None else region
    there, guess = (np.nan_to_num(d[chosen].astype(np.float64).ravel(), posinf=np.inf) for d in (truth, mine))
    known = there > 0
    there, guess = there[known], guess[known]
    limit = SETTINGS.depth_clip_m
    cut = np.where(guess > 0, np.minimum(guess, limit), limit) - np.minimum(there, limit)
    valid = np.isfinite(there)
    guess, there = guess[valid], there[valid]
    both = np.isfinite(guess) & (guess > 0)
    error = guess[both] - there[both]
    ratio = np.full(len(there), np.inf)
    ratio[both] = np.maximum(guess[both] / there[both], there[both] / guess[both])
    return {
        "mae": mean_or_nan(np.abs(cut)),
        "rmse": math.sqrt(mean_or_nan(cut**2)),
        "absrel": mean_or_nan(np.abs(error) / there[both]),
        **{f"delta{limit:g}": mean_or_nan(ratio < limit) for limit in SETTINGS.depth_deltas},
        "coverage": mean_or_nan(both),
    }


OCCLUDED_PX = 1.0
"""A pixel is hidden in the right view where another of more than this much more disparity lands on the same place."""


def is_known(disparity: Float32Array | Float64Array) -> BoolArray:
    """True where a disparity was given; below 0 it is of something far in a rig with doffs."""
    return np.isfinite(disparity) & (disparity != 0)


def disparity_errors(mine: Float32Array, truth: Float32Array, region: BoolArray | None = None) -> dict[str, float]:
    """Errors over the pixels of a region whose true disparity is known.

    Args:
        mine: H x W pixels; 0, NaN or inf = missing.
        truth: likewise.
        region: H x W; None = everywhere.
    Returns:
        bad-1, bad-2 (shares 0..1 that are off by more than 1 or 2 pixels; a missing estimate is bad), epe (mean
        error in pixels where the estimate is there), coverage (the share where it is); nan where no pixel counts.
    """
    counted = is_known(truth) if region is None else is_known(truth) & region
    guess, there = mine[counted].astype(np.float64), truth[counted].astype(np.float64)
    given = is_known(guess)
    error = np.full(len(there), np.inf)
    error[given] = np.abs(guess[given] - there[given])
    return {
        **{f"bad-{limit:g}": mean_or_nan(error > limit) for limit in SETTINGS.disparity_bad_px},
        "epe": mean_or_nan(error[given]),
        "coverage": mean_or_nan(given),
    }


def left_right_difference(
    left: UInt8Array, right: UInt8Array, disparity: Float32Array, region: BoolArray | None = None
) -> float:
    """Mean absolute difference, in levels 0..255, of the left picture and the right one warped onto it.

    The right picture is read at x - d, linearly between columns. Left out are pixels without disparity, those that
    fall outside the right picture, and those that something nearer hides in it.

    Args:
        left, right: H x W x 3 (or H x W).
        disparity: H x W pixels, of the left picture.
        region: H x W of the left picture; None = everywhere.
    Returns:
        nan where no pixel is left.
    """
    counted = visible_in_right(disparity)
    rows, columns = np.nonzero(counted if region is None else counted & region)
    at = columns - disparity[rows, columns].astype(np.float64)
    first = np.floor(at).astype(np.int64)
    second = np.minimum(first + 1, disparity.shape[1] - 1)
    weight = (at - first).reshape(-1, *[1] * (left.ndim - 2))
    warped = (1 - weight) * right[rows, first] + weight * right[rows, second]
    return mean_or_nan(np.abs(left[rows, columns] - warped).ravel())


def visible_in_right(disparity: Float32Array) -> BoolArray:
    """H x W, True where a left pixel has disparity, falls inside the right picture, and nothing nearer lies over it."""
    height, width = disparity.shape
    rows, columns = np.nonzero(is_known(disparity))
    shift = disparity[rows, columns].astype(np.float64)
    at = columns - shift
    inside = (at >= 0) & (at <= width - 1)
    rows, columns, shift, at = rows[inside], columns[inside], shift[inside], at[inside]
    nearest = np.full((height, width), -np.inf)
    left, right = np.floor(at).astype(np.int64), np.ceil(at).astype(np.int64)
    np.maximum.at(nearest, (rows, left), shift)
    np.maximum.at(nearest, (rows, right), shift)
    seen = np.zeros((height, width), np.bool_)
    # both columns that linear reading mixes must be free
    seen[rows, columns] = np.maximum(nearest[rows, left], nearest[rows, right]) <= shift + OCCLUDED_PX
    return seen


def cloud_scores(estimate: Float64Array, truth: Float64Array) -> dict[str, float]:
    """How far the estimate lies from the truth, how much of the truth it covers, and both in one; by a k-d tree.

    As in Knapitsch et al., "Tanks and Temples" (2017): precision is the share of estimated points nearer than a threshold to
    the truth, recall the share of true points nearer than it to the estimate, the F-score their harmonic mean.

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
    scores = {"accuracy": mean_or_nan(there), "completeness": mean_or_nan(back)}
    for threshold in SETTINGS.cloud_thresholds_m:
        precision, recall = mean_or_nan(there < threshold), mean_or_nan(back < threshold)
        both = precision + recall
        scores[f"fscore_{threshold:.2f}"] = 2 * precision * recall / both if both > 0 else 0.0
    if len(estimate) + len(truth) == 0:
        return dict.fromkeys(scores, math.nan)
    return scores


def nearest_distances(points: Float64Array, others: Float64Array) -> Float64Array:
    """For each of N points the distance to the nearest of M others: N metres, nan where there are no others."""
    if len(points) == 0 or len(others) == 0:
        return np.full(len(points), np.nan)
    spatial = import_extra("scipy.spatial", "cloud metrics", "scipy", "evaluate")
    return np.asarray(spatial.cKDTree(others).query(points)[0], np.float64)
