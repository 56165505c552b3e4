"""A mask in; whether it is inverted or too small out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.rgbd import BoolArray, percent
from dlama.perception.diagnosis.finding import Finding, Observed, certainty

MOSTLY = 0.5
"""Largest share of the picture of an object to remove,"""
BORDER = 0.6
"""and of the picture's border."""
FEWEST_PX = 12


def looks_inverted(mask: BoolArray) -> bool:
    """True if the mask covers most of the picture and of its border, so that an object stays and the scene goes."""
    border = np.concatenate([mask[0], mask[-1], mask[1:-1, 0], mask[1:-1, -1]])
    return bool(mask.mean() > MOSTLY and border.mean() > BORDER)


def check_mask_coverage(seen: Observed) -> list[Finding]:
    """Reports a mask of wrong polarity, or with hardly any pixels."""
    if seen.mask is None:
        return []
    if not looks_inverted(seen.mask):
        covered = int(seen.mask.sum())
        what = f"{seen.names[2]}: removes only {covered} pixels of the picture"
        return [Finding("tiny-mask", "note", 0.8, what)] if covered < FEWEST_PX else []
    what = f"{seen.names[2]}: would remove {percent(seen.mask)} of the picture and most of its border; white seems to mean keep"
    mend = "give the other `mask_polarity` (known: white stays)"
    return [Finding("inverted-mask", "fault", certainty(seen.mask.mean() - 0.4, 0.15), what, mend)]
