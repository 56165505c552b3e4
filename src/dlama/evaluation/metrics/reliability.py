"""Probabilities of being right, expected errors and the truth in; how far they can be relied on out. Pure.

Calibration: of pixels predicted to be right with probability p, a share p is (Guo et al. 2017). Sparsification: when the least
confident pixels are removed, the mean error of the rest should fall as fast as when the worst are (Ilg et al. 2018).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import BoolArray, UInt8Array

BINS = 10
"""Of equal width, 0..1."""
STEPS = np.linspace(0, 0.99, 100)
"""Shares that are removed."""
AGREEING = 0.8
"""Share of the pixels that both frames of a pair show whose colours are to agree within the tolerance of a right fill."""
LEAST_PIXELS = 100
"""Pixels that both show, below which their cameras are not compared."""


class Bins(NamedTuple):
    """BINS numbers each, as shares of all pixels: how many there are, the sum of their predictions, and how many are right."""

    share: Float64Array
    predicted: Float64Array
    right: Float64Array

    @property
    def error(self) -> float:
        """Expected calibration error: the differences of predicted and right, summed over all bins."""
        return float(np.abs(self.predicted - self.right).sum())

    @property
    def measures(self) -> dict[str, float]:
        """bin_0_share, bin_0_predicted, bin_0_right, bin_1_share, ..."""
        return {f"bin_{k}_{name}": float(part[k]) for k in range(BINS) for name, part in self._asdict().items()}

    @classmethod
    def of_measures(cls, found: Mapping[str, float]) -> Bins:
        """The way back, from these among others."""
        return cls(*(np.array([found[f"bin_{k}_{name}"] for k in range(BINS)]) for name in cls._fields))


def calibration(predicted: NDArray[np.floating], right: BoolArray) -> Bins:
    """Bins of N probabilities and of whether each was right."""
    number = np.minimum((predicted * BINS).astype(int), BINS - 1)
    sums = [np.bincount(number, weights=part, minlength=BINS) for part in (np.ones(len(predicted)), predicted, right)]
    return Bins(*(one.astype(np.float64) / len(predicted) for one in sums))


def color_tolerance(mine: UInt8Array, truth: UInt8Array, both: BoolArray, least: float) -> float:
    """Levels of 8 bit (mean over channels) within which a filled colour is right: `least`, or what AGREEING of the pixels that
    both frames show meet, if that is more.

    Two cameras with white balances and vignettings of their own disagree by more than `least` where the surface is the same;
    no filler can know that.

    Args:
        mine: H x W x 3, the source carried over to the truth's camera, in its exposure.
        truth: H x W x 3.
        both: H x W, True = both frames show the surface.
    """
    if np.count_nonzero(both) < LEAST_PIXELS:
        return least
    levels = np.abs(mine[both].astype(np.float32) - truth[both]).mean(1)
    return max(least, float(np.quantile(levels, AGREEING)))


def sparsification_area(confidence: NDArray[np.floating], error: NDArray[np.floating]) -> float:
    """Area between two curves, in mean errors: the mean error of what is left when the least confident (N numbers) of N errors
    are removed, and when the largest are. 0: the order is perfect."""

    def curve(by: NDArray[np.floating]) -> Float64Array:
        kept = error[np.argsort(by, kind="stable")].astype(np.float64)  # least confident first
        left = np.cumsum(kept[::-1])[::-1] / np.arange(len(kept), 0, -1)
        return np.asarray(left[(STEPS * len(kept)).astype(int)] / max(float(error.mean()), 1e-9))

    return float((curve(confidence) - curve(-error)).mean())


def by_distance(hole: BoolArray, color_hole: BoolArray) -> Float64Array:
    """H x W, a confidence by a formula, to be compared with: 0.5 at the rim of a hole (0.75 where the colour is measured), halved
    every 5 % of the diagonal."""
    distance = cv2.distanceTransform(hole.astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(np.where(color_hole, 0.5, 0.75) * np.exp2(-distance / (0.05 * np.hypot(*hole.shape))), np.float64)
