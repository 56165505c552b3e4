"""An estimated and a true depth map and a region in -> errors in metres and shares of right pixels out.

Every true pixel is valid (finite, > 0), far (inf) or missing (0, NaN); where the truth is missing nothing is counted.
Two rules then, because sky has no metres:

- `mae` and `rmse` count every pixel whose truth is valid or far, both depths cut at `clip_m`: sky is at `clip_m`, and so
  is an estimate that is far or missing.
- `mae_uncut`, `rmse_uncut` and `absrel` count the pixels where truth and estimate are both valid, in full metres;
  `coverage` is their share of the validly true pixels. `delta*` counts all validly true pixels, and an estimate that
  is far or missing is wrong there.
"""

from __future__ import annotations

import math

import numpy as np

from dlama.errors import ShapeError
from dlama.evaluation.metrics.pictures import SETTINGS, mean_or_nan
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import BoolArray, Float32Array


def depth_errors(
    mine: Float32Array, truth: Float32Array, region: BoolArray | None = None, clip_m: float = SETTINGS.depth_clip_m
) -> dict[str, float]:
    """Depth errors over a region; the rules stand at the top of the file.

    Args:
        mine: H x W metres; 0 or NaN = missing, inf = far.
        truth: likewise.
        region: H x W; None = everywhere.
        clip_m: metres, where `mae` and `rmse` cut both.
    Returns:
        mae, rmse, mae_uncut, rmse_uncut (metres), absrel, delta1.05, delta1.25, coverage (0..1); nan where no pixel
        counts.
    Raises:
        ShapeError: the shapes differ.
    """
    for name, array in (("mine", mine), ("the region", region)):
        if array is not None and array.shape != truth.shape:
            raise ShapeError(f"depth: {name} is {array.shape} and the truth {truth.shape}; the same is expected")
    chosen = slice(None) if region is None else region
    there, guess = (np.nan_to_num(d[chosen].astype(np.float64).ravel(), posinf=np.inf) for d in (truth, mine))
    known = there > 0
    there, guess = there[known], guess[known]
    cut = np.where(guess > 0, np.minimum(guess, clip_m), clip_m) - np.minimum(there, clip_m)
    return {"mae": mean_or_nan(np.abs(cut)), "rmse": math.sqrt(mean_or_nan(cut**2)), **_valid_errors(guess, there)}


def _valid_errors(guess: Float64Array, there: Float64Array) -> dict[str, float]:
    valid = np.isfinite(there)
    guess, there = guess[valid], there[valid]
    both = np.isfinite(guess) & (guess > 0)
    error = guess[both] - there[both]
    ratio = np.full(len(there), np.inf)
    ratio[both] = np.maximum(guess[both] / there[both], there[both] / guess[both])
    return {
        "mae_uncut": mean_or_nan(np.abs(error)),
        "rmse_uncut": math.sqrt(mean_or_nan(error**2)),
        "absrel": mean_or_nan(np.abs(error) / there[both]),
        **{f"delta{limit:g}": mean_or_nan(ratio < limit) for limit in SETTINGS.depth_deltas},
        "coverage": mean_or_nan(both),
    }
