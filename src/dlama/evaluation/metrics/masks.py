"""The truth in; where to click on an object, and which pixels its shadow darkens, out."""

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


def innermost_pixel(where: BoolArray) -> tuple[int, int]:
    """x, y of the pixel farthest from where `where` (H x W, not empty) ends; the picture's rim ends it too."""
    distance = cv2.distanceTransform(np.pad(where.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    row, column = np.unravel_index(int(distance.argmax()), distance.shape)
    return int(column), int(row)


def largest_region(where: BoolArray) -> BoolArray:
    """The largest 8-connected region of `where` (H x W, not empty)."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(where.astype(np.uint8), connectivity=8)
    return np.asarray(labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()))


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
