"""Remaining shadows: a view with a removed object in; the mask of its shadow on the surroundings out.

Those pixels were measured and stay as they are, but no hole may be painted with them: that would show the removed object.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.holes import (
    dilate_square,
    distance_to,
    erode_mask,
    morphological_open,
    nearest_known,
    shrink_mask,
    smaller_size,
    square,
)
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.perception.shadows.lit_surface import log_luma, quadratic, robust_fit

GRID = 256
"""Longer side of the coarse picture in which shadows are searched."""
DARKEST = 1.2
"""Natural logarithm of how much darker a shadow is, in 8-bit values, at most: a fourteenth of the light is left."""


def find_remaining_shadow(view: View, label: NDArray[np.int8], law: Law) -> BoolArray:
    """H x W, True where a plane next to a removed object is darker than its lit surface, and than anywhere farther away.

    label: H x W, the surface of each pixel. What lies far behind the object, a dark window, is no shadow of it; estimated depth
    is too inexact to see any.
    """
    own = view.object_hole
    if not own.any() or view.hole.all() or (view.origin == Origin.ESTIMATED.value).any():
        return np.zeros_like(own)
    wh = smaller_size(own.shape, GRID)
    distance = distance_to(shrink_mask(own, wh) > 0.25)  # cells of which more than a quarter is in it
    reach = np.sqrt((distance == 0).sum()) + 2
    luma = log_luma(view.color)
    out = np.zeros(wh[::-1], np.bool_)
    ring = (distance > 0) & (distance <= 3)
    for number in np.unique(cv2.resize(label.astype(np.int16), wh, interpolation=cv2.INTER_NEAREST)[ring]).tolist():
        on = (label == number) & ~view.hole
        share = shrink_mask(on, wh)
        surface = (share > 0.5) & (distance > 0)
        if number < 1 or not (surface & ring).any():
            continue
        level = cv2.resize(luma * on, wh, interpolation=cv2.INTER_AREA) / np.maximum(share, 1e-3)
        out |= find_shadow_on(surface, np.asarray(level, np.float32), distance, reach)
    out = dilate_square(out, 3)
    full = cv2.resize(out.astype(np.uint8), own.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    removed = depth_of_removed(view, law) if full.any() else None
    if removed is not None:
        size = np.sqrt(own.sum()) * np.median(removed[own]) / view.camera.fx
        full &= np.abs(view.depth - removed) < 1.5 * size
    return np.asarray(full & ~view.hole)


def depth_of_removed(view: View, law: Law) -> Float32Array | None:
    """H x W m, the depth of the removed object at its nearest inner pixel; None where the law of this camera has none."""
    removed = np.zeros(view.depth.shape, np.float32)
    for camera, measured in law.measured:
        if camera.same_view_as(view.camera):
            removed = np.where(
                (view.hole_type == HoleType.OBJECT.value) & np.isfinite(measured), measured, np.float32(0)
            )
    if not removed.any():
        return None
    inner = next(inner for px in (8, 4, 0) if (inner := erode_mask(removed > 0, px)).any())  # masks are grown
    return np.asarray(removed.ravel()[nearest_known(inner)[1]])


def find_shadow_on(surface: BoolArray, level: Float32Array, distance: Float32Array, reach: float) -> BoolArray:
    """h x w, the shadow on one surface (h x w bool). level: h x w logarithm of its brightness; distance: cells to the object."""
    beyond = surface & (distance > reach) & (distance <= 3 * reach)
    near = surface & (distance <= reach)
    if beyond.sum() < 60 or not near.any():  # too few to show a pattern
        return np.zeros_like(surface)
    rows, columns = np.nonzero(near | beyond)
    height, width = surface.shape
    design, seen = quadratic(columns / width, rows / height), level[rows, columns]
    dark = np.zeros_like(level)  # below the lit surface, a quadratic over the pixels
    dark[rows, columns] = (design @ robust_fit(design, seen.astype(np.float64))).astype(np.float32) - seen
    core = max(0.12, 1.25 * float(np.quantile(dark[beyond], 0.98)))  # equal darkness farther away is a pattern
    darker = morphological_open(near & (dark > core / 2), square(3))
    number = cv2.connectedComponents(darker.astype(np.uint8), connectivity=4)[1]
    adjacent = np.unique(number[near & (distance <= 2) & (dark > core)])
    return np.isin(number, [one for one in adjacent if one and np.median(dark[number == one]) <= DARKEST])
