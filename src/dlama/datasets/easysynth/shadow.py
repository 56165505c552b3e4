"""A frame with and without an object, and the object's mask, in; where the object casts its shadow, out."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import box_around, box_mean, dilate_mask, larger_box, sides_of
from dlama.geometry.rgbd import BoolArray, UInt8Array

EDGE_PX = 3
"""Round the mask colour is a mix of object and background (anti-aliasing, JPEG ringing), neither object nor shadow."""
SMOOTHING_PX = 5
"""Side of the box over which darkening is averaged: noise and compression are finer than any shadow."""
DARKER_LEVELS = 6.0
DARKER_SHARE = 0.08
"""A shadow takes away this many levels and this share of the light (of luma without the object)."""
SMALLEST_SHARE = 2e-4
"""Of the picture, 50 px of 512 x 512; smaller darkened regions are noise."""
NEIGHBOURHOOD = 1.5
"""A shadow may lie as far from the object's box as this many times the box's diagonal."""
SAME_EXPOSURE_LEVELS = 2.0


def cast_shadow(color: UInt8Array, without: UInt8Array, mask: BoolArray) -> BoolArray | None:
    """H x W, True = in the object's shadow and not (near) the object; None where it cannot be found or there is none.

    Darkening is luma without the object minus luma with it, averaged over a box of SMOOTHING_PX. A pixel is dark where that is
    at least DARKER_LEVELS and DARKER_SHARE of its luma without. The shadow is all 8-connected regions of dark pixels that
    touch the neighbourhood of the object (its box grown by NEIGHBOURHOOD diagonals), lie outside the mask dilated by EDGE_PX
    and cover at least SMALLEST_SHARE of the picture. A change of colour without darkening is no shadow.
    None as well where the medians outside say that the two frames differ in exposure. color, without: H x W x 3 uint8 RGB.
    """
    if not mask.any() or mask.all():
        return None
    near = dilate_mask(mask, EDGE_PX)
    if near.all():
        return None
    before, after = (np.asarray(cv2.cvtColor(each, cv2.COLOR_RGB2GRAY), np.float32) for each in (color, without))
    if np.abs(np.median((after - before)[~near])) > SAME_EXPOSURE_LEVELS:
        return None
    outside = (~near).astype(np.float32)  # the object's own change must not bleed out
    lost, light = (box_mean(each, outside, SMOOTHING_PX) for each in (after - before, after))
    dark = ~near & (lost >= DARKER_LEVELS) & (lost >= DARKER_SHARE * light)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(dark.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= SMALLEST_SHARE * mask.size
    large[0] = False  # what is not dark
    touching = np.zeros(len(stats), bool)
    touching[np.unique(labels[_neighbourhood(mask)])] = True
    shadow = (large & touching)[labels]
    return shadow if shadow.any() else None


def _neighbourhood(mask: BoolArray) -> tuple[slice, slice]:
    """The mask's box, grown by NEIGHBOURHOOD times its diagonal, within the picture."""
    tight = box_around(mask, 0)
    return larger_box(tight, int(NEIGHBOURHOOD * np.hypot(*sides_of(tight))), mask.shape)
