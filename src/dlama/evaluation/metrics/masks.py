"""A picture with and without an object in; which pixels its shadow darkens, by the truth, out."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import box_mean, dilate_mask
from dlama.geometry.rgbd import BoolArray, UInt8Array

DARKER = 0.1
"""Share of its luma that a pixel loses at least in a shadow,"""
DARKER_LEVELS = 3.0
"""and levels of 0..255: less is compression."""
SMALLEST_SHADOW_PX = 60
"""A smaller shadow counts as none."""
EDGE_PX = 2
"""Around the object colours are mixes of it and the background."""


def outside_contact_band(mask: BoolArray) -> BoolArray:
    """H x W, False on an object and within EDGE_PX of it, where a mask with its shadow holds the contact line."""
    return ~dilate_mask(mask, EDGE_PX)


def darkened_by_shadow(color: UInt8Array, without: UInt8Array, mask: BoolArray) -> BoolArray:
    """H x W, True where an object reduces the luma by a tenth or more, outside its mask; means of 3 x 3 px are compared.

    color, without: H x W x 3, the picture with and without the object.
    """
    outside = outside_contact_band(mask).astype(np.float32)
    luma = [cv2.cvtColor(each, cv2.COLOR_RGB2GRAY).astype(np.float32) for each in (color, without)]
    shown, true = (box_mean(each, outside, 3) for each in luma)
    return np.asarray((true - shown >= np.maximum(DARKER * true, DARKER_LEVELS)) & (outside > 0))
