"""A metric in; its name in tables, its good side, its digits and the paper's own number out.

The paper's numbers (Müller et al., VISAPP 2025, tables 1 and 2) are of other data: its frames (Unreal, Downtown West) are
not published, and its masks, scenes and sky differ from every data set here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

Which = tuple[str, str, str]
"""Region, modality, metric."""

MASK_RATIO: Which = ("whole", "rgb", "mask_ratio")
"""Share of the picture that the recipe had to fill."""


def list_columns(regions: Sequence[str], metrics: Mapping[str, str]) -> tuple[Which, ...]:
    """The metrics (modality -> names, with blanks between them) of each region."""
    return tuple(
        (region, modality, metric)
        for region in regions
        for modality, names in metrics.items()
        for metric in names.split()
    )


PAPER_SHAPE = list_columns(("whole",), {"rgb": "ssim lpips mse", "depth": "ssim lpips mse"})
"""The columns of the paper's tables 1 and 2."""
WHOLE: tuple[Which, ...] = (MASK_RATIO, *PAPER_SHAPE)
"""Those with the share to fill before them."""

HIGHER = ("ssim", "psnr", "delta", "precision", "recall", "fscore", "coverage")
LOWER = (
    "lpips", "mse", "mae", "rmse", "absrel", "accuracy", "completeness", "bad", "epe", "seconds", "peak", "error", "difference",
    "offset", "spread", "leak", "violation", "broken", "changed", "photometric", "ece", "ause",
)  # fmt: skip
"""Words with which names of metrics begin, or which are in them."""

MODALITIES = {
    "rgb": "colour",
    "depth": "depth (8 bit)",
    "depth_m": "depth",
    "cloud": "cloud",
    "disparity": "disparity",
    "confidence": "confidence",
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
    "leaks": "leaks, % of the seen pixels",
    "edge_offset": "edges off colour edges, px",
    "edge_offset_truth": "edges off colour edges in the truth, px",
    "law_violations": "law violations, px",
    "law_broken": "law broken, % of the filled pixels",
    "channel_spread": "spread of channels, levels",
    "changed_pixels": "changed, px",
    "mse_source": "MSE against the source",
    "photometric": "left to right, levels",
    "photometric_at_truth": "left to right by the true disparity, levels",
    "photometric_truth": "left to right of the truth, levels",
}
METRES = ("mae", "rmse", "accuracy", "completeness")
"""Metrics in metres where the modality is depth_m or cloud."""


PAPER = "paper, other data"
"""What the column is called."""
PAPER_SOURCE = (
    "Müller, Sentosa, Kolb, Müller, Kranzlmüller, VISAPP 2025, tables 1 (colour) and 2 (depth): Big-LaMa on the paper's own, "
    "unpublished frames. Other data, so these numbers set the scale and are not to be beaten one by one."
)

PAPER_MASK_RATIO = {"±10": 27.19, "±20": 42.37, "±30": 52.42, "±40": 59.49, "±50": 64.87, "±60": 68.96}
"""Percent of the picture that was to be filled."""

PAPER_COLOR = {
    "ssim": {"±10": 0.7617, "±20": 0.6593, "±30": 0.5839, "±40": 0.5292, "±50": 0.4873, "±60": 0.4559},
    "lpips": {"±10": 0.1859, "±20": 0.3134, "±30": 0.4035, "±40": 0.4752, "±50": 0.5221, "±60": 0.5651},
    "mse": {"±10": 522.05, "±20": 1065.91, "±30": 1657.52, "±40": 2337.43, "±50": 2871.92, "±60": 3284.25},
}
"""Table 1."""

PAPER_DEPTH = {
    "ssim": {"±10": 0.9016, "±20": 0.8847, "±30": 0.8712, "±40": 0.8680, "±50": 0.8648, "±60": 0.8506},
    "lpips": {"±10": 0.1850, "±20": 0.2195, "±30": 0.2523, "±40": 0.2640, "±50": 0.2727, "±60": 0.3091},
    "mse": {"±10": 186.54, "±20": 393.29, "±30": 657.17, "±40": 868.91, "±50": 1074.61, "±60": 1452.72},
}
"""Table 2."""

HIDDEN = ("unseen", "disoccluded", "out-of-view", "object", "mask", "mask-right")
"""Regions that the source camera did not see, by the truth: what a filler is for."""
KNOWN = ("seen", "ring", "outside", "shadow", "whole")
INTEREST = {
    "rgb": "ssim lpips mse psnr",
    "depth": "ssim lpips mse",
    "depth_m": "mae absrel delta1.05 delta1.25",
    "disparity": "bad-1 bad-2 epe",
    "cloud": "accuracy completeness fscore_0.02 fscore_0.05 fscore_0.10",
}
"""What the main tables show; everything else is in the tables of artifacts."""
PER_YAW_HIDDEN = list_columns(("unseen",), {"rgb": "lpips psnr", "depth_m": "mae"})
REMOVAL = list_columns(
    ("mask",), {"rgb": "ssim lpips mse", "depth_m": "mae", "cloud": "fscore_0.05", "disparity": "bad-1"}
)
VARIANT_METRICS = (
    *list_columns(("whole", "unseen", "mask"), {"rgb": "ssim lpips mse", "depth": "mse", "depth_m": "mae"}),
    ("shadow", "rgb", "mse"),
)


def better_direction(metric: str) -> int:
    """+1: more is better, -1: less is, 0: it only describes."""
    if metric.endswith("_truth"):  # what the truth itself has, to hold the methods against
        return 0
    if any(metric.startswith(word) for word in HIGHER):
        return 1
    return -1 if any(word in metric for word in LOWER) else 0


def column_title(region: str, modality: str, metric: str) -> str:
    """`colour SSIM`, `depth MAE, m`."""
    name = METRICS.get(metric, metric.replace("delta", "δ<").replace("fscore_", "F-score at "))
    if (modality, metric) == MASK_RATIO[1:]:
        return name
    if metric == MASK_RATIO[2]:
        return f"{modality} {name}"
    unit = ", m" if modality in ("depth_m", "cloud") and metric in METRES else ""
    return f"{MODALITIES.get(modality, modality)} {name}{unit}"


def format_value(value: float, metric: str) -> str:
    """A value with the digits that tables show."""
    if not math.isfinite(value):
        return "∞" if value > 0 else "-∞"
    if metric in ("mse", "mask_ratio", "share", "psnr", "seconds", "seconds_scored", "peak_mib"):
        return f"{value:.2f}"
    return f"{value:.4f}" if abs(value) < 100 else f"{value:.1f}"


def paper_value(yaw: str, region: str, modality: str, metric: str) -> float | None:
    """The paper's number of whole pictures at that yaw (`±10`); None where it has none."""
    if (region, modality, metric) == MASK_RATIO:
        return PAPER_MASK_RATIO.get(yaw)
    if region != "whole":
        return None
    return {"rgb": PAPER_COLOR, "depth": PAPER_DEPTH}.get(modality, {}).get(metric, {}).get(yaw)
