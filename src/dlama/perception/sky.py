"""A picture with its measured or matched depth in; the pixels that show plain sky, and disparity without its matches, out.

Sensors and matchers give the sky no depth, or any. Outdoors, a large plain part at the upper edge of the picture, bluish or much
brighter than the rest, is sky. What has no texture along the rows matches anything: sky takes the disparity of a roof, a lined
door that of the sky. Such matches are dropped; their depth is missing then, and filled like that of other missing pixels.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import shrink_mask, smaller_size
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, is_valid
from dlama.perception.resampling import shrink_color

GRID = 192
"""Longer side of the picture in which the sky is looked for."""
OUTDOORS_M = 6.0
"""Least depth of the farthest hundredth of what is measured outdoors; depth cameras in rooms reach less."""
ALONG_TOP = 0.1
"""Least share of the upper edge of the largest part of a sky."""


def find_plain_sky(color: UInt8Array, free: BoolArray, depth: Float32Array) -> BoolArray:
    """H x W, True in pixels that show plain sky; clouds and the rim of the sky may be left out.

    color: H x W x 3; free: H x W, the pixels that may be sky; depth: H x W metres as measured, 0 or inf elsewhere.
    """
    nothing = np.zeros_like(free)
    if free[0].mean() < ALONG_TOP:
        return nothing
    measured = depth[is_valid(depth)][::16]
    if not measured.size or np.quantile(measured, 0.99) < OUTDOORS_M:
        return nothing
    hw = smaller_size(free.shape, GRID)[::-1]
    small = shrink_color(color, hw).astype(np.float32)
    grey = small @ np.array([0.299, 0.587, 0.114], np.float32)
    cells = shrink_mask(free, hw[::-1]) >= 0.5
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    # in the sky neighbouring pixels of the grid differ by less than 3 grey levels
    plain = (np.maximum(cv2.dilate(grey, cross) - grey, grey - cv2.erode(grey, cross)) < 3).astype(np.uint8)
    _, part = cv2.connectedComponents(plain, connectivity=4)
    sky, large = np.zeros(hw, np.bool_), False
    for number in np.unique(part[0][plain[0] > 0]):
        whole = part == number
        this = whole & cells
        area = this.mean()
        # of a plain part most must be free to be sky: a ceiling continues where it was measured
        if area < max(0.001, 0.75 * whole.mean()) or this.all() or not looks_like_sky(small[this], grey, this):
            continue
        sky |= this
        large |= area >= 0.02 and this[0].mean() >= ALONG_TOP
    if not large:
        return nothing
    return free & (cv2.resize(sky.view(np.uint8), free.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0)


def looks_like_sky(color: Float32Array, grey: Float32Array, part: BoolArray) -> bool:
    """Whether a part (h x w) of a picture is bluish, or brighter than the rest and not warm.

    color: N x 3 levels, of the part; grey: h x w levels, of the whole.
    """
    red, _, blue = np.median(color, 0)
    return bool(blue - red > 12 or (np.median(grey[part]) - np.median(grey[~part]) > 40 and red - blue < 10))


def drop_plain_infinity(color: UInt8Array, disparity: Float32Array, depth: Float32Array) -> Float32Array:
    """H x W px, 0 where what was matched is plain sky, or is at infinity without texture.

    color: H x W x 3; disparity: H x W px, 0 = unknown; depth: H x W metres, that of the disparity; inf = at infinity.
    """
    doubtful, far = find_plain_sky(color, np.ones(depth.shape, np.bool_), depth), np.isposinf(depth)
    if far.any():
        grey = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY).astype(np.float32)
        steps = np.abs(cv2.Sobel(cv2.GaussianBlur(grey, (0, 0), 2), cv2.CV_32F, 1, 0, scale=1 / 8))
        doubtful |= far & (cv2.blur(steps, (9, 9)) < 1)  # without texture: levels a pixel along the rows
    return np.where(doubtful, np.float32(0), disparity)
