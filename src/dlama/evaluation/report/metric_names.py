"""A metric's name in; how it is called, which side is good, and how many digits it deserves, out."""

from __future__ import annotations

import math

Which = tuple[str, str, str]
"""Region, modality, metric."""

MASK_RATIO: Which = ("whole", "rgb", "mask_ratio")
"""Share of the picture that the recipe had to fill."""
PAPER_SHAPE: tuple[Which, ...] = tuple(
    ("whole", modality, metric) for modality in ("rgb", "depth") for metric in ("ssim", "lpips", "mse")
)
"""The columns of the paper's tables 1 and 2."""

HIGHER = ("ssim", "psnr", "delta", "precision", "recall", "fscore", "coverage", "iou", "untouched")
LOWER = (
    *("lpips", "mse", "mae", "rmse", "absrel", "accuracy", "completeness", "bad", "epe", "seconds", "peak", "error"),
    *("difference", "offset", "spread", "leak", "violation", "broken", "changed", "photometric"),
)
"""Words with which names of metrics begin, or which are in them."""

MODALITIES = {
    "rgb": "colour",
    "depth": "depth (8 bit)",
    "depth_m": "depth",
    "cloud": "cloud",
    "disparity": "disparity",
}
METRICS = {
    "ssim": "SSIM",
    "lpips": "LPIPS",
    "mse": "MSE",
    "psnr": "PSNR, dB",
    "mae": "MAE",
    "rmse": "RMSE",
    "absrel": "AbsRel",
    "epe": "EPE, px",
    "mask_ratio": "mask ratio, %",
    "share": "share of the picture, %",
}
METRES = (
    "mae",
    "rmse",
    "mae_uncut",
    "rmse_uncut",
    "accuracy",
    "completeness",
    "accuracy_median",
    "completeness_median",
)
"""Metrics in metres where the modality is depth_m or cloud."""


def better(metric: str) -> int:
    """+1: more is better, -1: less is, 0: it only describes."""
    if metric.endswith("_truth"):  # what the truth itself has, to hold the methods against
        return 0
    if any(metric.startswith(word) for word in HIGHER):
        return 1
    return -1 if any(word in metric for word in LOWER) else 0


def titled(region: str, modality: str, metric: str) -> str:
    """`colour SSIM`, `depth MAE, m`."""
    name = METRICS.get(metric, metric.replace("delta", "δ<").replace("fscore_", "F-score at "))
    unit = ", m" if modality in ("depth_m", "cloud") and metric in METRES else ""
    return f"{MODALITIES.get(modality, modality)} {name}{unit}"


def shown(value: float, metric: str) -> str:
    """A value with as many digits as tell methods apart."""
    if not math.isfinite(value):
        return "∞" if value > 0 else "-∞"
    if metric in ("mse", "mask_ratio", "share", "psnr", "seconds", "seconds_scored", "peak_mib"):
        return f"{value:.2f}"
    return f"{value:.4f}" if abs(value) < 100 else f"{value:.1f}"
