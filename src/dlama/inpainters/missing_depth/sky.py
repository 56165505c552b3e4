"""A picture with missing depth in; the missing pixels that show sky out.

Sensors and matchers give the sky no depth. Outdoors, a large plain part at the upper edge of the picture, bluish or much brighter
than what was measured, is sky.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.view import View
from dlama.perception.resampling import shrink_color

GRID = 192
"""Longer side of the picture in which the sky is looked for."""
LUMA = np.array([0.299, 0.587, 0.114], np.float32)
STEP = 3.0
"""Largest step between neighbouring pixels of the grid, in grey levels, in the sky."""
SAMPLED = 16
"""Every so manyth measured pixel is asked for its depth."""
OUTDOORS_M = 6.0
"""Least depth of the farthest hundredth of what is measured outdoors; depth cameras in rooms reach less."""
BLUE, BRIGHT, WARM = 12.0, 40.0, 10.0
"""Levels by which blue exceeds red, or grey exceeds the median of what was measured; and by which red may exceed blue then."""
LARGEST, ALONG_TOP, SMALLEST = 0.02, 0.1, 0.001
"""Of the largest part of a sky, its least share of the picture and of the upper edge; least share of further parts."""


def find_sky(view: View) -> BoolArray:
    """H x W, True in pixels of a view without depth that show plain sky; clouds and the rim of the sky may be left out."""
    missing, near = view.depth_hole, view.valid
    if missing[0].mean() < ALONG_TOP or not near.any() or np.quantile(view.depth[near][::SAMPLED], 0.99) < OUTDOORS_M:
        return np.zeros_like(missing)
    height, width = missing.shape
    step = max(1.0, max(height, width) / GRID)
    hw = max(1, round(height / step)), max(1, round(width / step))
    small = shrink_color(view.color, hw).astype(np.float32)
    grey, free = small @ LUMA, shrink(missing, hw)
    plain = (free & (steps_to_neighbours(grey) < STEP)).astype(np.uint8)
    measured = shrink(near, hw)
    usual = float(np.median(grey[measured])) if measured.any() else 0.0
    _, part, stats, _ = cv2.connectedComponentsWithStats(plain, connectivity=4)
    sky, large = np.zeros(hw, np.bool_), False
    for number in np.unique(part[0][plain[0] > 0]):
        area, this = stats[number, cv2.CC_STAT_AREA] / plain.size, part == number
        if area < SMALLEST or not looks_like_sky(small[this], grey[this], usual):
            continue
        sky |= this
        large |= area >= LARGEST and this[0].mean() >= ALONG_TOP
    if not large:
        return np.zeros_like(missing)
    return missing & (cv2.resize(sky.view(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0)


def looks_like_sky(color: Float32Array, grey: Float32Array, usual: float) -> bool:
    """Whether the N pixels of a part (colours N x 3, grey levels N) are bluish, or bright and not warm. usual: grey level."""
    red, _, blue = np.median(color, 0)
    return bool(blue - red > BLUE or (np.median(grey) - usual > BRIGHT and red - blue < WARM))


def steps_to_neighbours(grey: Float32Array) -> Float32Array:
    """h x w, the largest difference of a grey level (h x w) from one of its four neighbours'."""
    across, down = np.abs(np.diff(grey, axis=1)), np.abs(np.diff(grey, axis=0))
    out = np.zeros_like(grey)
    for side, step in ((out[:, 1:], across), (out[:, :-1], across), (out[1:], down), (out[:-1], down)):
        np.maximum(side, step, out=side)
    return out


def shrink(mask: BoolArray, hw: tuple[int, int]) -> BoolArray:
    """h x w, True where most of a cell is True in a mask (H x W)."""
    return np.asarray(cv2.resize(mask.astype(np.uint8) * 255, hw[::-1], interpolation=cv2.INTER_AREA) > 127)
