"""Telea by OpenCV: a view with holes in; colour and depth, filled separately from all sides of the hole, out.

Depth goes through as inverse depth (0 = far) in 16 bit: OpenCV 5's Telea on float32 returns wrong values even on a constant
plane, on uint16 it is right.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import larger_box
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, paste
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Painter

RADIUS = 3
"""Neighbourhood of cv2.inpaint in pixels."""


def diffuse(view: View, context: FillContext, seed: int) -> Fill:
    """Fill colour (8 bit) and inverse depth (16 bit, full scale = the nearest pixel) by cv2.inpaint."""
    w = inverse_depth(view.known_depth)
    scale = float(w.max()) / 65535 or 1.0
    levels = paint(np.round(w / scale).astype(np.uint16), view.hole)
    return Fill(paint(view.color, view.hole), depth_of_levels(levels, scale))


def paint(picture: np.ndarray, hole: BoolArray, seed: int = 0) -> np.ndarray:
    """A picture (uint8 H x W x 3, or uint16 H x W) with the hole filled by cv2.inpaint, which draws nothing from the seed.

    Parts of the hole that lie farther apart than it looks are filled side by side, each within its box: the same pixels.
    """
    if len(picture) == 1:  # of a single row OpenCV reads memory that it did not set
        return paint(picture.repeat(3, 0), hole.repeat(3, 0))[1:2]
    square = np.ones((2 * RADIUS + 1, 2 * RADIUS + 1), np.uint8)
    parts, boxes = cv2.connectedComponentsWithStats(cv2.dilate(hole.view(np.uint8), square))[1:3]
    out, order = picture.copy(), 1 + np.argsort(-boxes[1:, cv2.CC_STAT_AREA], kind="stable")

    def fill(first: int, last: int) -> None:
        for number in order[first:last]:
            left, top, width, height, _ = boxes[number]
            box = larger_box((slice(top, top + height), slice(left, left + width)), RADIUS, hole.shape)
            part = hole[box] & (parts[box] == number)
            filled = cv2.inpaint(np.ascontiguousarray(picture[box]), part.view(np.uint8), RADIUS, cv2.INPAINT_TELEA)
            paste(filled, part, out[box])

    in_bands(fill, len(order), band=1)
    return out


def depth_of_levels(levels: np.ndarray, scale: float) -> Float32Array:
    """Metres from inverse depth in steps of `scale` (1/m); level 0 is far (+inf)."""
    out = np.full(levels.shape, np.inf, np.float32)
    np.divide(1 / scale, levels, out=out, where=levels > 0, casting="unsafe")
    return out


telea = Painter(diffuse, paint)
