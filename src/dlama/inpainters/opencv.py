"""Diffusion: a view with holes in; colour and depth, filled separately from all sides of the hole by OpenCV's Telea, out; and
colours at known pixels spread to all pixels, which ignores surfaces.

Depth goes through as inverse depth (0 = far) in 16 bit: OpenCV 5's Telea on float32 returns wrong values even on a constant
plane, on uint16 it is right.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from dlama.geometry.holes import larger_box, shrink_known, smaller_size
from dlama.geometry.kernels.enlarging import enlarge_at
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, paste
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Paint, Painter

RADIUS = 3
"""Neighbourhood of cv2.inpaint in pixels."""
LARGEST = 256
"""Longer side of the picture in which `spread_small` works, in pixels: the result is a blur in any case."""


def diffuse(view: View, context: FillContext, seed: int) -> Fill:
    """Fill colour (8 bit) and inverse depth (16 bit, full scale = the nearest pixel) by cv2.inpaint."""
    w = inverse_depth(view.known_depth)
    scale = float(w.max()) / 65535 or 1.0
    levels = paint(np.round(w / scale).astype(np.uint16), view.hole)
    depth = np.full(levels.shape, np.inf, np.float32)  # of level 0
    np.divide(1 / scale, levels, out=depth, where=levels > 0, casting="unsafe")
    return Fill(paint(view.color, view.hole), depth)


def paint(picture: np.ndarray, hole: BoolArray, seed: int = 0) -> np.ndarray:
    """A picture (uint8 H x W x 3, or uint16 H x W) with the hole filled by cv2.inpaint, which draws nothing from the seed.

    Parts of the hole that lie farther apart than it looks are filled side by side, each within its box: the same pixels.
    """
    for axis in (0, 1):
        if hole.shape[axis] == 1:  # of a single row or column OpenCV reads memory that it did not set
            return paint(picture.repeat(3, axis), hole.repeat(3, axis)).take([1], axis)
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


telea = Painter(paint, diffuse)


def with_diffused_depth(paint: Paint, notes: Callable[[], dict[str, Any]]) -> Painter:
    """A Painter of a function that fills pictures, whose own way with depth is diffusion; notes: what ran, for meta.json."""

    def fill(view: View, context: FillContext, seed: int) -> Fill:
        return Fill(paint(view.color, view.color_hole, seed), diffuse(view, context, seed).depth, notes=notes())

    return Painter(paint, fill, notes)


def spread_small(colors: np.ndarray, known: BoolArray, where: BoolArray | None = None) -> Float32Array:
    """H x W x 3: the known colours spread to all pixels; where: H x W, the N pixels that are needed: N x 3.

    It is the mean of pull-push and Telea, whose errors differ, computed with LARGEST pixels at most and enlarged.
    """
    height, width = known.shape
    colors, share = shrink_known(colors, known, smaller_size(known.shape, LARGEST))
    known = share >= 0.5
    filled = np.asarray((pull_push(colors, known) + telea_spread(colors, known)) / 2, np.float32)
    pixels = np.arange(height * width) if where is None else np.flatnonzero(where)
    out = enlarge_at(filled, pixels, width, (height / len(filled), width / filled.shape[1]))
    return out.reshape(height, width, 3) if where is None else out


def telea_spread(colors: np.ndarray, known: BoolArray) -> Float32Array:
    """H x W x 3: colours (levels of 8 bit) spread to all pixels by Telea."""
    if not known.any():
        return np.asarray(colors, np.float32)
    return paint(np.round(np.clip(colors, 0, 255)).astype(np.uint8), ~known).astype(np.float32)


def pull_push(colors: np.ndarray, known: BoolArray) -> Float32Array:
    """H x W x 3: coarser the farther off (pull-push, Gortler et al. 1996); known colours stay as they are."""
    weight = known.astype(np.float32)
    levels: list[tuple[np.ndarray, np.ndarray]] = [(colors * weight[..., None], weight)]
    while max(levels[-1][1].shape) > 2:
        levels.append((cv2.pyrDown(levels[-1][0]), cv2.pyrDown(levels[-1][1])))
    sums, weight = levels[-1]
    mean: np.ndarray = sums / np.maximum(weight, 1e-6)[..., None]
    for sums, weight in reversed(levels[1:-1]):
        share = np.minimum(weight, 1)[..., None]
        coarse = cv2.pyrUp(mean, dstsize=weight.shape[::-1])
        mean = sums / np.maximum(weight, 1e-6)[..., None] * share + coarse * (1 - share)
    if len(levels) > 1:
        mean = cv2.pyrUp(mean, dstsize=known.shape[::-1])
    out = np.asarray(mean, np.float32)
    np.copyto(out, colors, where=known[..., None])
    return out
