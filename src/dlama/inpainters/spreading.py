"""Values at known pixels in; a smooth extrapolation to all pixels out: pull-push and Telea, which ignore surfaces."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from dlama.geometry.holes import shrink_known, smaller_size
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.opencv import paint

LARGEST = 512
"""Longer side of the picture in which `spread_small` works, in pixels: the result is a blur in any case."""

Spread = Callable[[np.ndarray, BoolArray], Float32Array]
"""(H x W x C values, H x W known) -> H x W x C, extrapolated to all pixels."""


def spread_small(
    values: np.ndarray, known: BoolArray, spread: Spread, largest: int = LARGEST, where: BoolArray | None = None
) -> Float32Array:
    """As `spread`, computed with `largest` pixels at most and enlarged; where: H x W, the N pixels that are needed: N x C."""
    height, width = known.shape
    if largest >= max(height, width):
        found = spread(values.astype(np.float32), known)
        return found if where is None else found[where]
    small, share = shrink_known(values, known, smaller_size(known.shape, largest))
    filled = spread(small, share >= 0.5)
    out = np.empty((*known.shape, filled.shape[2]) if where is None else (where.sum(), filled.shape[2]), np.float32)
    for channel in range(filled.shape[2]):  # one at a time: at full size they are floats
        large = cv2.resize(filled[..., channel], (width, height), interpolation=cv2.INTER_LINEAR)
        out[..., channel] = large if where is None else large[where]
    return out


def telea_spread(values: np.ndarray, known: BoolArray) -> Float32Array:
    """As Spread, by Telea: three channels (levels of 8 bit) in 8 bit, one in 16."""
    if not known.any():
        return np.asarray(values, np.float32)
    if values.shape[2] == 3:
        return paint(np.round(np.clip(values, 0, 255)).astype(np.uint8), ~known).astype(np.float32)
    scale = float(values[known].max()) / 65535 or 1.0
    levels: np.ndarray = np.round(np.clip(values[..., 0] / scale, 0, 65535)).astype(np.uint16)
    return (paint(levels, ~known) * np.float32(scale))[..., None]


def pull_push(values: np.ndarray, known: BoolArray) -> Float32Array:
    """As Spread: coarser the farther off (pull-push, Gortler et al. 1996); known values stay as they are."""
    weight = known.astype(np.float32)
    levels: list[tuple[np.ndarray, np.ndarray]] = [(values * weight[..., None], weight)]
    while max(levels[-1][1].shape) > 2:
        levels.append((_halve(levels[-1][0]), cv2.pyrDown(levels[-1][1])))
    sums, weight = levels[-1]
    mean = sums / np.maximum(weight, 1e-6)[..., None]
    for sums, weight in reversed(levels[1:-1]):
        share = np.minimum(weight, 1)[..., None]
        mean = sums / np.maximum(weight, 1e-6)[..., None] * share + _double(mean, weight.shape) * (1 - share)
    if len(levels) > 1:
        mean = _double(mean, known.shape)
    out = np.asarray(mean, np.float32)
    np.copyto(out, values, where=known[..., None])
    return out


def spread_by_two(values: np.ndarray, known: BoolArray) -> Float32Array:
    """As Spread: the mean of pull-push and Telea, whose errors differ."""
    return np.asarray((pull_push(values, known) + telea_spread(values, known)) / 2, np.float32)


def _halve(values: np.ndarray) -> np.ndarray:
    """H x W x C at half the size, under a Gaussian."""
    small = cv2.pyrDown(values)
    return small.reshape(*small.shape[:2], -1)


def _double(values: np.ndarray, hw: tuple[int, ...]) -> np.ndarray:
    """H x W x C at twice the size, about: hw."""
    return cv2.pyrUp(values, dstsize=(hw[1], hw[0])).reshape(*hw, -1)
