"""Missing depth filled along colours in; the same, but beyond the sensor's range where that ended, out.

A depth camera sees nothing beyond its range: what is large and begins there is no hole in a near surface.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import dilate_mask, distance_to
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.perception.missing_depth.along_colors import DepthByColor
from dlama.perception.missing_depth.between_readings import reach_between
from dlama.perception.planes import SMOOTH

FARTHEST_SHARE, AT_LIMIT = 0.005, 0.9
"""Share of the known pixels that are farther than the sensor's range, and depth over it from which a pixel is at its end."""
LEAST_SHARE, BEGINS, RIM_PX = 0.04, 0.3, 3
"""Of a missing part beyond the range: its least share of the picture; the least share of the known pixels round it at the
range's end; and how far round it they are looked for."""


def move_beyond_range(filled: DepthByColor, w: Float32Array, missing: BoolArray, hole: BoolArray) -> DepthByColor:
    """Depth that is no nearer than the sensor's range in the parts that lie beyond it.

    w: H x W inverse depth (1/m) as known; missing: H x W, where depth alone is missing; hole: H x W, where depth is unknown.
    """
    near = ~hole & (w > 0)
    if missing.mean() < LEAST_SHARE or not near.any():
        return filled
    limit = np.float32(np.quantile(w[near], FARTHEST_SHARE))
    moved = find_beyond_range(w, missing, near, limit) & filled.reached & (filled.inverse_depth > limit)
    if not moved.any():
        return filled
    depth, label = np.where(moved, limit, filled.inverse_depth), np.where(moved, np.int8(SMOOTH), filled.label)
    return DepthByColor(depth, label, filled.reached)


def find_beyond_range(w: Float32Array, missing: BoolArray, near: BoolArray, limit: np.float32) -> BoolArray:
    """H x W, True in missing parts that lie beyond the range. near: H x W, known pixels; limit: inverse depth at its end."""
    out = np.zeros_like(missing)
    reach = reach_between(near)
    wide = missing & (distance_to(near) > reach)
    count, part, stats, _ = cv2.connectedComponentsWithStats(wide.view(np.uint8), connectivity=8)
    for number in range(1, count):
        if stats[number, cv2.CC_STAT_AREA] < LEAST_SHARE * missing.size:
            continue
        this = missing & dilate_mask(part == number, round(1.5 * reach))  # into right-angled corners, too
        rim = w[dilate_mask(this, RIM_PX) & near]
        if rim.size and (rim < limit / AT_LIMIT).mean() >= BEGINS:
            out |= this
    return out
