"""A shadow and the picture in; whether its step exceeds the contrast of the surface's fine pattern out.

Under a faint shadow on cobbles the stones differ by more than the shadow darkens them. Filling it would replace the true
pattern, which costs more than the shadow: it stays as it is.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import box_mean, dilate_mask
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array

FINE = 20
"""Fine pattern is the difference from the mean over this fraction of the picture's longer side."""
GAP_PX, RING_PX, RING_SHARE = 3, 12, 0.15
"""The ring for comparison: from GAP_PX to RING_PX and this share of the shadow's size."""
FEWEST_PX = 20
"""Fewer pixels of either decide nothing."""
STEPS = 1.0
"""Least step of a shadow, in standard deviations of the pattern."""


def has_contrast(rgbd: RGBD, shadow: BoolArray, usable: BoolArray) -> bool:
    """Whether the ground round a shadow (H x W) is lighter, in the median or the mean, by more than the standard deviation of
    its fine pattern (inside or outside, the smaller). usable: H x W, where the surface is seen. True where too little is seen."""
    inside = shadow & usable
    reach = RING_PX + round(RING_SHARE * float(np.sqrt(shadow.sum())))
    ring = dilate_mask(shadow, reach) & ~dilate_mask(shadow, GAP_PX) & usable
    if min(inside.sum(), ring.sum()) < FEWEST_PX:
        return True
    level = np.log(cv2.cvtColor(rgbd.color, cv2.COLOR_RGB2GRAY).astype(np.float32) + 4)
    fine = fine_pattern(level, usable)
    steps = [float(how(level[ring]) - how(level[inside])) for how in (np.median, np.mean)]  # of two materials one errs
    return max(steps) > STEPS * min(float(fine[inside].std()), float(fine[ring].std()))


def fine_pattern(level: Float32Array, usable: BoolArray) -> Float32Array:
    """H x W level less its mean over the visible part of a window, a FINE-th of the picture wide."""
    side = 2 * (max(level.shape) // FINE // 2) + 1
    return level - box_mean(level, usable.astype(np.float32), side)
