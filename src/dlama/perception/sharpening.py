"""A map with blurred edges and its picture in; the map with edges where the picture has them out.

Estimated depth changes over many pixels where the scene has a step. Seen from elsewhere, such a ramp is a fringe between two
surfaces.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from dlama.geometry.holes import dilate_square, smaller_size
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.perception.kernels.joint_filters import MOST, joint_median, take_most_alike
from dlama.perception.resampling import nearest_pixels, shrink_color

LARGEST = 1024
"""Longer side of the picture, in pixels, in which edges are moved. In a larger one each pixel then takes, of the values found
round it, the one with the most similar colour."""
RADIUS, SPACE_SIGMA, COLOR_SIGMA = 18.0, 12.0, 20.0
"""Half the window that votes, more than half a ramp's width; how fast votes weaken with distance, and with unlike colour
(levels of 0..255). All lengths are px of a picture whose longer side is 512."""
STEEP, BEND = 0.02, 1.6
"""Relative change per px from which a pixel is on a ramp: it does not vote; and least slope of a ramp over the mean slope within
1.5 radii: ground is not steeper than its surroundings."""
FURTHER, FURTHER_RADIUS, FURTHER_COLOR_SIGMA = 2, 4.0, 60.0
"""Further medians, in which moved pixels vote, too: on a texture neighbours choose different depths in the first one, and seen
from elsewhere a surface is torn between them; half their window, and how fast their votes weaken with unlike colour."""


def sharpen_depth(
    values: Float32Array, color: UInt8Array, inverse: bool = True, where: BoolArray | None = None
) -> Float32Array:
    """H x W, each value one that the map has nearby: on ramps the weighted median of adjacent pixels of the same colour.

    values: H x W inverse depth, or depth where not `inverse` (ramps are found in inverse depth, in which planes are linear; the
    median is the same of both); color: H x W x 3, RGB; where: H x W, the pixels that are needed, None = all.
    """
    if max(values.shape) > LARGEST:
        hw = smaller_size(values.shape, LARGEST)[::-1]
        small, small_color = nearest_pixels(values, hw), shrink_color(color, hw)
        found = sharpen_depth(small, small_color, inverse, None if where is None else nearest_pixels(where, hw))
        changed, out = dilate_square(found != small, 3), values.copy()
        in_bands(take_most_alike, len(out), color, small_color, found, changed, out)
        return out
    size = max(values.shape) / 512
    near = values if inverse else inverse_depth(values)
    ramp = on_ramp(near, STEEP / size, BEND, round(1.5 * RADIUS * size))
    blurred = dilate_square(ramp, 2 * round(4 * size) + 1)  # 4 px round a ramp are replaced, too
    if where is not None:
        reach = math.ceil(FURTHER * FURTHER_RADIUS * size)  # as far as further medians look
        blurred &= dilate_square(where, 2 * reach + 1)
    if not ramp.any() or ramp.all():
        return values
    smooth = np.asarray(cv2.GaussianBlur(color, (0, 0), 0.7), np.uint8)
    out = _median(values, blurred, ~ramp, smooth, RADIUS * size, COLOR_SIGMA, SPACE_SIGMA * size)
    radius, all_vote = FURTHER_RADIUS * size, np.ones_like(blurred)
    for _ in range(FURTHER):
        out = _median(out, blurred, all_vote, smooth, radius, FURTHER_COLOR_SIGMA, radius / 1.5)
    return out


def _median(
    values: Float32Array,
    blurred: BoolArray,
    votes: BoolArray,
    color: UInt8Array,
    radius: float,
    color_sigma: float,
    space_sigma: float,
) -> Float32Array:
    """`joint_median` in all rows, of a window of at most 15 x 15 voters."""
    px = max(2, round(radius))
    step = max(1, math.ceil((2 * px + 1) / 15))
    out, room = np.empty_like(values), np.empty((len(values), 2, MOST), np.float32)
    differences = np.arange(min(40 * color_sigma**2, 3 * 255**2) + 1)  # who differs more counts for nothing
    alike = np.exp(-differences / (2 * color_sigma**2)).astype(np.float32)
    places = np.arange(-px, px + 1, step)
    near = np.exp(-(places[:, None] ** 2 + places**2) / (2 * space_sigma**2)).astype(np.float32)
    marks = np.ascontiguousarray(values), blurred, votes, color
    in_bands(joint_median, len(values), *marks, px, step, alike, near, room, out)
    return out


def on_ramp(values: Float32Array, steep: float, bend: float, reach: int) -> BoolArray:
    """H x W, True where a map changes by more than `steep` of itself per px, and by `bend` times the mean within `reach` px."""
    finite = np.where(np.isfinite(values), values, np.float32(0))
    smooth = cv2.GaussianBlur(finite, (0, 0), 1.0)
    dx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=1 / 8)
    dy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=1 / 8)
    slope = np.hypot(dx, dy)
    around = cv2.blur(slope, (2 * reach + 1, 2 * reach + 1))
    return np.asarray((slope > steep * np.maximum(np.abs(smooth), 1e-12)) & (slope > bend * around))
