"""A picture with its matched disparity in; the same without matches of plain sky, and of plain surfaces at infinity, out.

What has no texture along the rows matches anything: sky takes the disparity of a roof, a lined door that of the sky. Its depth is
missing then, and filled like that of other missing pixels.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.perception.sky import find_plain_sky

BLUR_PX, AROUND_PX, TEXTURED = 2.0, 9, 1.0
"""Sigma of the blur that removes noise, width of the surroundings, and their mean gradient along rows, in grey levels per pixel,
from which a match at infinity counts."""


def drop_plain_infinity(color: UInt8Array, disparity: Float32Array, depth: Float32Array) -> Float32Array:
    """H x W px, 0 where what was matched is plain sky, or is at infinity without texture.

    color: H x W x 3; disparity: H x W px, 0 = unknown; depth: H x W metres, that of the disparity; inf = at infinity.
    """
    doubtful, far = find_plain_sky(color, np.ones(depth.shape, np.bool_), depth), np.isposinf(depth)
    if far.any():
        doubtful |= far & ~has_texture(color)
    return np.where(doubtful, np.float32(0), disparity)


def has_texture(color: UInt8Array) -> BoolArray:
    """H x W, True where colours (H x W x 3) change along the rows."""
    grey = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY).astype(np.float32)
    steps = np.abs(cv2.Sobel(cv2.GaussianBlur(grey, (0, 0), BLUR_PX), cv2.CV_32F, 1, 0, scale=1 / 8))
    return np.asarray(cv2.blur(steps, (AROUND_PX, AROUND_PX)) >= TEXTURED)
