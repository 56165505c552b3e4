"""A picture with a hole, and a coarse guess, in; an image pyramid of both, with texture channels, out."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import box_around, dilate_square
from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, paste
from dlama.inpainters.patchmatch import pyramid_kernels as kernels
from dlama.inpainters.patchmatch.kernels import HALF

TEXTURE = 2.0
"""Weight of the two channels of texture next to the three of colour: without them grass turns to cloth (Newson et al. 2014)."""
TEXTURE_PX = 5
"""Side of the square over which texture is averaged."""
SMALLEST_SIDE = 40
"""Pixels: the least side of a level is half of this."""
DEEPEST = 8.0
"""Depth in px of the hole on the coarsest level. If deeper, the guess has too much weight; if shallower, its structure is
lost."""
FEWEST_SOURCES = 50


@dataclass(frozen=True)
class Level:
    """A level of the pyramid."""

    values: Float32Array
    """H x W x 5: RGB, and the mean gradients across and along there; of the guess in the hole."""
    hole: BoolArray
    """H x W."""
    sources: BoolArray
    """H x W, centres of patches that are whole and known."""
    label: NDArray[np.int32]
    """H x W, the surface of each pixel."""


def build_pyramid(picture: UInt8Array, hole: BoolArray, guess: UInt8Array, label: NDArray[np.int32]) -> list[Level]:
    """Levels from the picture itself to the coarsest, each half of the one before.

    picture, guess: H x W x 3 RGB; hole: H x W. The last level is the first in which the hole is as narrow as DEEPEST, or the last
    in which enough whole patches are known.
    """
    values = describe_pixels(picture, ~hole)
    box = box_around(hole, TEXTURE_PX)
    paste(describe_pixels(guess[box], np.ones_like(hole[box])), hole[box], values[box])
    levels = [Level(values, hole, whole_patches(hole), label)]
    while hole_depth(hole) > DEEPEST and min(hole.shape) >= SMALLEST_SIDE:
        values, hole = halve(values, hole)
        sources = whole_patches(hole)
        if sources.sum() < FEWEST_SOURCES or not hole.any():
            break
        label = np.ascontiguousarray(label[::2, ::2])
        levels.append(Level(values, hole, sources, label))
    return levels


def describe_pixels(picture: UInt8Array, known: BoolArray) -> Float32Array:
    """H x W x 5 in known pixels: colours (0 .. 255), and TEXTURE times the mean change of brightness between known neighbours."""
    picture = as_input(picture)
    changes = np.empty((2, *known.shape), np.float32)
    in_bands(kernels.change_rows, len(known), picture, known, *changes)
    side = (TEXTURE_PX, TEXTURE_PX)
    share = np.maximum(cv2.blur(known.astype(np.float32), side), np.float32(1e-6))
    across, along = (cv2.blur(change, side) for change in changes)
    out = np.empty((*known.shape, 5), np.float32)
    in_bands(kernels.describe_rows, len(known), picture, across, along, share, np.float32(TEXTURE), known, out)
    return out


def halve(values: Float32Array, hole: BoolArray) -> tuple[Float32Array, BoolArray]:
    """Values (H x W x C) and hole (H x W) at half the size, rounded up: means of what is known, in the hole of what fills it."""
    rows, columns = ((size + 1) // 2 for size in hole.shape)
    out, smaller = np.empty((rows, columns, values.shape[2]), np.float32), np.empty((rows, columns), np.bool_)
    in_bands(kernels.halve_rows, rows, values, hole, out, smaller)
    return out, smaller


def whole_patches(hole: BoolArray) -> BoolArray:
    """H x W, True in the centres of patches inside the picture and outside the hole."""
    out = ~dilate_by_patch(hole)
    out[:HALF] = out[-HALF:] = False
    out[:, :HALF] = out[:, -HALF:] = False
    return out


def dilate_by_patch(hole: BoolArray) -> BoolArray:
    """H x W, True in the centres of patches that overlap the hole."""
    return dilate_square(hole, 2 * HALF + 1)


def hole_depth(hole: BoolArray) -> float:
    """Distance in px of the hole's innermost pixel from known ones; beyond the border nothing is known."""
    wider = cv2.copyMakeBorder(hole.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    return float(cv2.distanceTransform(wider, cv2.DIST_L2, 3).max())
