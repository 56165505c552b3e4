"""The paper's own numbers (Müller et al., VISAPP 2025, tables 1 and 2), to stand beside ours as what they are: of other data.

The paper's frames (Unreal, Downtown West) are not published; its masks, scenes and sky differ from every data set here.
"""

from __future__ import annotations

PAPER = "paper, other data"
"""What the column is called."""
SOURCE = (
    "Müller, Sentosa, Kolb, Müller, Kranzlmüller, VISAPP 2025, tables 1 (colour) and 2 (depth): Big-LaMa on the paper's own, "
    "unpublished frames. Other data, so these numbers set the scale and are not to be beaten one by one."
)

MASK_RATIO = {"±10": 27.19, "±20": 42.37, "±30": 52.42, "±40": 59.49, "±50": 64.87, "±60": 68.96}
"""Percent of the picture that was to be filled."""

COLOR = {
    "ssim": {"±10": 0.7617, "±20": 0.6593, "±30": 0.5839, "±40": 0.5292, "±50": 0.4873, "±60": 0.4559},
    "lpips": {"±10": 0.1859, "±20": 0.3134, "±30": 0.4035, "±40": 0.4752, "±50": 0.5221, "±60": 0.5651},
    "mse": {"±10": 522.05, "±20": 1065.91, "±30": 1657.52, "±40": 2337.43, "±50": 2871.92, "±60": 3284.25},
}
"""Table 1."""

DEPTH = {
    "ssim": {"±10": 0.9016, "±20": 0.8847, "±30": 0.8712, "±40": 0.8680, "±50": 0.8648, "±60": 0.8506},
    "lpips": {"±10": 0.1850, "±20": 0.2195, "±30": 0.2523, "±40": 0.2640, "±50": 0.2727, "±60": 0.3091},
    "mse": {"±10": 186.54, "±20": 393.29, "±30": 657.17, "±40": 868.91, "±50": 1074.61, "±60": 1452.72},
}
"""Table 2."""


def paper_value(yaw: str, region: str, modality: str, metric: str) -> float | None:
    """What the paper says of whole pictures at that yaw (`±10`); None where it says nothing."""
    if region != "whole":
        return None
    return {"rgb": COLOR, "depth": DEPTH}.get(modality, {}).get(metric, {}).get(yaw)
