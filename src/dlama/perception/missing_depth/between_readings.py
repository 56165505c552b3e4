"""A picture whose depth is single readings, as of a LIDAR, in; the same with depth between them, along its colours, out. And
missing depth filled along colours, put beyond the sensor's range where that ended: what is large and begins there is no hole in
a near surface."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from dlama.arguments import check_arguments
from dlama.geometry.holes import dilate_mask, distance_to, nearest_known
from dlama.geometry.projection import depth_from_inverse
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, freeze
from dlama.geometry.view import View
from dlama.perception.missing_depth.along_colors import DepthByColor, fill_along_colors, find_known_surfaces
from dlama.perception.planes import SMOOTH

LEAST_SHARE, BEGINS, RIM_PX = 0.04, 0.3, 3
"""Of a missing part beyond the range: its least share of the picture; the least share of the known pixels round it at the
range's end; and how far round it they are looked for."""


def densify(rgbd: RGBD) -> RGBD:
    """The picture with depth between single readings, as those of a LIDAR; itself where its depth is none of single readings.

    Readings keep their values. What lies farther than the readings lie apart (above a LIDAR's first ring, say) stays missing, as
    the sky does. `view` and `remove` need it not; frames of `scene` do.
    """
    check_arguments(densify, locals())
    known = rgbd.depth > 0
    if not has_single_readings(known):
        return rgbd
    view = View.from_rgbd(rgbd)
    surfaces, sky = find_known_surfaces(view.color, view.known_depth, view.depth_hole)
    filled = fill_along_colors(view.color, view.depth_hole, view.hole, surfaces, sky)
    between = filled.reached & ~sky & (distance_to(known) <= reach_between(known))
    depth = np.where(between, depth_from_inverse(filled.inverse_depth), rgbd.depth)
    return dataclasses.replace(rgbd, depth=freeze(depth))


def has_single_readings(known: BoolArray) -> bool:
    """Whether most known pixels (H x W) have none above and below them, or none at their sides: points or lines of a scan."""
    if known.all():
        return False
    near = np.pad(known, 1)
    alone = ~(near[:-2, 1:-1] | near[2:, 1:-1]) | ~(near[1:-1, :-2] | near[1:-1, 2:])
    return bool((alone & known).sum() > 0.5 * known.sum())


def reach_between(known: BoolArray) -> int:
    """Pixels from a known one (H x W) up to which depth is missing between readings: a fiftieth of the picture's longer side, or
    four mean spacings of readings."""
    return round(max(0.02 * max(known.shape), 4 / known.mean() ** 0.5))


def repeat_readings(depth: Float32Array) -> Float32Array:
    """H x W metres (0 = missing): between single readings that of the nearest one, without a picture; other depth as it is."""
    known = depth > 0
    if not has_single_readings(known):
        return depth
    distance, nearest = nearest_known(known)
    return np.where(distance <= reach_between(known), depth.ravel()[nearest], np.float32(0))


def move_beyond_range(filled: DepthByColor, w: Float32Array, missing: BoolArray, hole: BoolArray) -> DepthByColor:
    """Depth that is no nearer than the sensor's range in the parts that lie beyond it.

    w: H x W inverse depth (1/m) as known; missing: H x W, where depth alone is missing; hole: H x W, where depth is unknown.
    """
    near = ~hole & (w > 0)
    if missing.mean() < LEAST_SHARE or not near.any():
        return filled
    limit = np.float32(np.quantile(w[near], 0.005))  # hardly a known pixel is farther
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
        if rim.size and (rim < limit / 0.9).mean() >= BEGINS:  # nearly at the limit
            out |= this
    return out
