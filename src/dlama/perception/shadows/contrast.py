"""A shadow that was found and the picture in; whether its step is more than the surface's own fine pattern out.

Under a faint shadow on cobbles the stones differ among themselves by more than the shadow darkens them. What is filled in there
differs from the truth by the pattern, so that more is lost by filling than the shadow takes away: it stays as it is.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import box_mean, dilate_mask
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array

FINE = 20
"""What differs from its mean over this part of the picture's longer side is a fine pattern."""
GAP_PX, RING_PX, RING_SHARE = 3, 12, 0.15
"""A shadow is compared with the surface round it, from GAP_PX on as far as RING_PX and this share of the shadow's size."""
FEWEST_PX = 20
"""Fewer pixels of either say nothing."""
STEPS = 1.0
"""Standard deviations of the pattern that a shadow's step is at least."""


def has_contrast(rgbd: RGBD, shadow: BoolArray, usable: BoolArray) -> bool:
    """Whether the ground round a shadow (H x W) is lighter, in the median or in the mean, by more than its fine pattern's
    standard deviation, in the shadow or round it, whichever is less. usable: H x W, where the surface is seen. True where too
    little of it is seen."""
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
    """H x W: a level less its mean over the part of a window, of a FINE-th of the picture, that shows the surface."""
    side = 2 * (max(level.shape) // FINE // 2) + 1
    return level - box_mean(level, usable.astype(np.float32), side)
