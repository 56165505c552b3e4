"""A mask in; whether it is inverted out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.rgbd import BoolArray, percent
from dlama.perception.diagnosis.finding import Finding, Observed, certainty

MOSTLY = 0.5
"""Largest share of the picture of an object to remove,"""
BORDER = 0.6
"""and of the picture's border."""


def looks_inverted(mask: BoolArray) -> bool:
    """True if the mask covers most of the picture and of its border, so that an object stays and the scene goes."""
    border = np.concatenate([mask[0], mask[-1], mask[1:-1, 0], mask[1:-1, -1]])
    return bool(mask.mean() > MOSTLY and border.mean() > BORDER)


def check_mask_coverage(seen: Observed) -> list[Finding]:
    """Reports a mask of wrong polarity."""
    if seen.mask is None or not looks_inverted(seen.mask):
        return []
    what = f"{seen.names[2]}: would remove {percent(seen.mask)} of the picture and most of its border; white seems to mean keep"
    mend = "give the other `mask_polarity` (known: white stays)"
    return [Finding("inverted-mask", "fault", certainty(seen.mask.mean() - 0.4, 0.15), what, mend)]
