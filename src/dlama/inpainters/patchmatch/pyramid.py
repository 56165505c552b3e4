"""A picture with a hole, and a rough guess, in; ever smaller ones of both, with what patches are compared by, out."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import square
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.patchmatch.kernels import HALF

TEXTURE = 2.0
"""Weight of the two channels of texture next to the three of colour: without them grass turns to cloth (Newson et al. 2014)."""
TEXTURE_PX = 5
"""Side of the square over which texture is averaged."""
SMALLEST_SIDE = 40
"""Pixels: no level is smaller than half of it."""
DEEPEST = 8.0
"""Pixels from the rim to the middle of the hole in the coarsest picture that is expected: deeper, the guess is believed too much,
and less deep its structure is lost."""
FEWEST_SOURCES = 50


@dataclass(frozen=True)
class Level:
    """A picture of the pyramid."""

    values: Float32Array
    """H x W x 5: RGB, and how much brightness changes across and along there; of the guess in the hole."""
    hole: BoolArray
    """H x W."""
    sources: BoolArray
    """H x W, the middles of patches that are whole and known."""
    label: NDArray[np.int32]
    """H x W, the surface of each pixel."""


def build_pyramid(picture: UInt8Array, hole: BoolArray, guess: UInt8Array, label: NDArray[np.int32]) -> list[Level]:
    """Levels from the picture itself to the coarsest, each half of the one before.

    picture, guess: H x W x 3 RGB; hole: H x W. The last level is the first in which the hole is as narrow as DEEPEST, or the last
    in which enough whole patches are known.
    """
    values, filled = describe_pixels(picture, ~hole), describe_pixels(guess, np.ones_like(hole))
    levels = [Level(np.where(hole[..., None], filled, values), hole, whole_patches(hole), label)]
    while hole_depth(hole) > DEEPEST and min(hole.shape) >= SMALLEST_SIDE:
        values, known = halve(values, (~hole).astype(np.float32))
        filled, _ = halve(filled, np.ones(hole.shape, np.float32))
        hole = known < 0.5
        sources = whole_patches(hole)
        if sources.sum() < FEWEST_SOURCES or not hole.any():
            break
        label = np.ascontiguousarray(label[::2, ::2])
        levels.append(Level(np.where(hole[..., None], filled, values), hole, sources, label))
    return levels


def describe_pixels(picture: UInt8Array, known: BoolArray) -> Float32Array:
    """H x W x 5: colours (0 .. 255), and TEXTURE times the mean change of brightness between known neighbours."""
    color = picture.astype(np.float32)
    grey, there = color.mean(2), known.astype(np.float32)
    across, along = np.zeros_like(grey), np.zeros_like(grey)
    across[:, 1:] = np.abs(np.diff(grey, axis=1)) * (known[:, 1:] & known[:, :-1])
    along[1:] = np.abs(np.diff(grey, axis=0)) * (known[1:] & known[:-1])
    side = (TEXTURE_PX, TEXTURE_PX)
    share = np.maximum(cv2.blur(there, side), np.float32(1e-6))
    texture = [TEXTURE * cv2.blur(change, side) / share for change in (across, along)]
    return np.concatenate([color, np.stack(texture, 2)], 2).astype(np.float32)


def halve(values: Float32Array, weight: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Values (H x W x C) and their weight (H x W, 0 .. 1) at half the size, rounded up; values are means of what counts."""
    (height, width), odd = weight.shape, [size % 2 for size in weight.shape]
    rim = ((0, odd[0]), (0, odd[1]))
    sums = cv2.GaussianBlur(
        np.pad(values * weight[..., None], (*rim, (0, 0))), (3, 3), 0.8, borderType=cv2.BORDER_CONSTANT
    )
    padded = np.pad(weight, rim)
    weights = cv2.GaussianBlur(padded, (3, 3), 0.8, borderType=cv2.BORDER_CONSTANT)
    rows, columns = (height + 1) // 2, (width + 1) // 2
    small = sums.reshape(rows, 2, columns, 2, -1).sum((1, 3))
    small_weights = weights.reshape(rows, 2, columns, 2).sum((1, 3))
    inside = cv2.resize(padded, (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(small / np.maximum(small_weights, 1e-6)[..., None], np.float32), np.asarray(inside, np.float32)


def whole_patches(hole: BoolArray) -> BoolArray:
    """H x W, True in the middles of patches that lie in the picture and hold no hole."""
    out = ~dilated_by_patch(hole)
    out[:HALF] = out[-HALF:] = False
    out[:, :HALF] = out[:, -HALF:] = False
    return out


def dilated_by_patch(hole: BoolArray) -> BoolArray:
    """H x W, True in the middles of patches that hold some of the hole."""
    return np.asarray(cv2.dilate(hole.astype(np.uint8), square(2 * HALF + 1)) > 0)


def hole_depth(hole: BoolArray) -> float:
    """Pixels from known ones to the hole's innermost pixel; beyond the border nothing is known."""
    wider = cv2.copyMakeBorder(hole.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    return float(cv2.distanceTransform(wider, cv2.DIST_L2, 3).max())
