"""Two pictures of one place in -> SSIM and squared-error maps, means over regions, and the gain between exposures out.

SSIM is scikit-image's (Wang et al. 2004). Every setting of every metric stands in `MetricSettings`; its hash stands next to
every table. Pictures are uint8, H x W x 3 or H x W (depth as `depth_8bit` makes it), both of the same shape; sums run
in float64, so the same input gives the same numbers on every run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dlama.errors import ShapeError, format_size, import_extra
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array


@dataclass(frozen=True)
class MetricSettings:
    """Every number that a metric's value depends on besides published constants. Colour's SSIM is the mean of its channels'."""

    data_range: float = 255.0
    """Of SSIM and PSNR: pictures are 0..255."""
    ssim_window: int = 7
    """Pixels, the side of SSIM's square window, whose pixels weigh the same."""
    depth_clip_m: float = 10.0
    """Metres: 8-bit depth is 255 from here on (the paper's clip), and `mae` and `rmse` of depth are cut here."""
    depth_deltas: tuple[float, ...] = (1.05, 1.25)
    cloud_thresholds_m: tuple[float, ...] = (0.02, 0.05, 0.10)
    disparity_bad_px: tuple[float, ...] = (1.0, 2.0)


SETTINGS = MetricSettings()
"""What the package measures with."""

GAIN_PIXELS = 100
"""With fewer usable pixels than this no gain is fitted."""


def ssim_map(truth: UInt8Array, mine: UInt8Array) -> Float64Array:
    """SSIM of every pixel, the mean over channels; the SSIM of a region is the mean of this map over it.

    Up to the border, where scikit-image's filter mirrors the picture: a region there is scored like any other. Only
    the score of a whole picture leaves the border out.

    Returns:
        H x W, in -1..1.
    Raises:
        ShapeError: a side is shorter than the window.
        MissingExtraError: scikit-image is not installed.
    """
    if min(truth.shape[:2]) < SETTINGS.ssim_window:
        raise ShapeError(
            f"pictures are {format_size(truth.shape)}; SSIM needs {SETTINGS.ssim_window} pixels or more a side"
        )
    _, full = import_extra("skimage.metrics", "SSIM", "scikit-image", "evaluate").structural_similarity(
        truth.astype(np.float64),
        mine.astype(np.float64),
        win_size=SETTINGS.ssim_window,
        data_range=SETTINGS.data_range,
        channel_axis=2 if truth.ndim == 3 else None,
        full=True,
    )
    return np.asarray(full.mean(2) if full.ndim == 3 else full)


def mse_map(truth: UInt8Array, mine: UInt8Array) -> Float64Array:
    """Squared difference of every pixel, the mean over channels: H x W, in 0..65025 (levels squared)."""
    squared = (truth.astype(np.float64) - mine.astype(np.float64)) ** 2
    return squared.mean(2) if squared.ndim == 3 else squared


def psnr(mse: float) -> float:
    """Peak signal to noise ratio in dB of a mean squared error: inf for 0, nan for nan."""
    return math.inf if mse == 0 else 10 * math.log10(SETTINGS.data_range**2 / mse)


def region_mean(values: Float64Array, region: BoolArray | None = None) -> float:
    """Mean of an H x W map over a region (None = everywhere); nan where the region is empty."""
    return float(values.mean()) if region is None else mean_or_nan(values[region])


def mean_or_nan(values: NDArray[Any]) -> float:
    """Mean of N numbers (or of N bools: the share that is True); nan where there are none."""
    return float(values.mean()) if len(values) else math.nan


def depth_8bit(depth: Float32Array) -> UInt8Array:
    """Depth as the paper shows it: 0..255 for 0..depth_clip_m metres, rounded; far and anything beyond is 255, missing is 0.

    Args:
        depth: H x W metres; 0 or NaN = missing, inf = far.
    """
    metres = np.where(np.isnan(depth), 0.0, depth).astype(np.float64)
    limit = SETTINGS.depth_clip_m
    return np.rint(np.clip(metres, 0.0, limit) * (255 / limit)).astype(np.uint8)


def channel_gain(mine: UInt8Array, truth: UInt8Array, region: BoolArray) -> tuple[float, float, float]:
    """The factor per channel that brings `mine` to the exposure of `truth`, fitted on a region that both show.

    Starts from the ratio of medians; then, three times, the ratio of means over the pixels that fit best (residual
    up to twice the median residual), so that what moved or does not match has no influence. Neither side is taken for
    exact, so noise does not pull the factor down as least squares would. Pixels near black or white are left out.

    Returns:
        Three factors; 1 for a channel with fewer than 100 usable pixels.
    """
    gains = [_gain(mine[..., c][region].astype(float), truth[..., c][region].astype(float)) for c in range(3)]
    return gains[0], gains[1], gains[2]


def _gain(mine: Float64Array, truth: Float64Array) -> float:
    usable = (np.minimum(mine, truth) >= 5) & (np.maximum(mine, truth) <= 250)
    if usable.sum() < GAIN_PIXELS:
        return 1.0
    mine, truth = mine[usable], truth[usable]
    gain = float(np.median(truth) / np.median(mine))
    for _ in range(3):
        residual = np.abs(truth - gain * mine)
        fits = residual <= max(2 * float(np.median(residual)), 1.0)
        gain = float(truth[fits].sum() / mine[fits].sum())
    return gain
