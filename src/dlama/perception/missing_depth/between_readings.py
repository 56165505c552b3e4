"""A picture whose depth is single readings, as of a LIDAR, in; the same with depth between them, along its colours, out."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.arguments import check_arguments
from dlama.geometry.holes import distance_to, nearest_known
from dlama.geometry.projection import depth_from_inverse
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, freeze
from dlama.geometry.view import View
from dlama.perception.missing_depth.along_colors import fill_along_colors, find_known_surfaces

REACH, SPACINGS = 0.02, 4.0
"""Distance from readings up to which depth is missing between them: over the picture's longer side, and over the mean spacing of
readings; the larger one counts."""
MOSTLY = 0.5
"""Share of the readings from which single ones make a picture's depth that of single readings."""


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
    return bool((alone & known).sum() > MOSTLY * known.sum())


def reach_between(known: BoolArray) -> int:
    """Pixels from a known one (H x W) up to which depth is missing between readings."""
    return round(max(REACH * max(known.shape), SPACINGS / known.mean() ** 0.5))


def repeat_readings(depth: Float32Array) -> Float32Array:
    """H x W metres (0 = missing): between single readings that of the nearest one, without a picture; other depth as it is."""
    known = depth > 0
    if not has_single_readings(known):
        return depth
    distance, nearest = nearest_known(known)
    return np.where(distance <= reach_between(known), depth.ravel()[nearest], np.float32(0))
