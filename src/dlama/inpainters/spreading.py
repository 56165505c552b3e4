"""Colours at known pixels in; a smooth extrapolation to all pixels out: pull-push and Telea, which ignore surfaces."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import shrink_known, smaller_size
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.opencv import paint

LARGEST = 256
"""Longer side of the picture in which `spread_small` works, in pixels: the result is a blur in any case."""


def spread_small(colors: np.ndarray, known: BoolArray, where: BoolArray | None = None) -> Float32Array:
    """H x W x 3: the known colours spread to all pixels; where: H x W, the N pixels that are needed: N x 3.

    It is the mean of pull-push and Telea, whose errors differ, computed with LARGEST pixels at most and enlarged.
    """
    height, width = known.shape
    if max(height, width) <= LARGEST:
        found = spread_by_two(colors.astype(np.float32), known)
        return found if where is None else found[where]
    small, share = shrink_known(colors, known, smaller_size(known.shape, LARGEST))
    filled = spread_by_two(small, share >= 0.5)
    out = np.empty((*known.shape, 3) if where is None else (where.sum(), 3), np.float32)
    for channel in range(3):  # one at a time: at full size they are floats
        large = cv2.resize(filled[..., channel], (width, height), interpolation=cv2.INTER_LINEAR)
        out[..., channel] = large if where is None else large[where]
    return out


def spread_by_two(colors: np.ndarray, known: BoolArray) -> Float32Array:
    """H x W x 3: the mean of `pull_push` and `telea_spread`."""
    return np.asarray((pull_push(colors, known) + telea_spread(colors, known)) / 2, np.float32)


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
