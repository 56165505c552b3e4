"""A picture with a hole, and a coarse guess, in; an image pyramid of both, with texture channels, out."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import box_around, dilate_square
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, paste, replace_pixels
from dlama.inpainters.patchmatch import kernels

TEXTURE = 2.0
"""Weight of the two channels of texture next to the three of colour: without them grass turns to cloth (Newson et al. 2014)."""
TEXTURE_PX = 5
"""Side of the square over which texture is averaged."""


@dataclass(frozen=True)
class Level:
    """A level of the pyramid."""

    values: Float32Array
    """H x W x 5: RGB, and the mean gradients across and along there; of the guess in the hole."""
    hole: BoolArray
    """H x W."""
    sources: BoolArray
    """H x W, centres of patches that are whole and known."""
    label: NDArray[np.integer]
    """H x W, the surface of each pixel."""


def shrink(
    values: np.ndarray, hole: BoolArray, label: NDArray[np.integer], times: int
) -> tuple[np.ndarray, BoolArray, NDArray[np.integer]]:
    """Values (H x W x C), their hole and their surfaces (H x W) so many times smaller, rounded up. A pixel is a hole if more than
    half of those under it are; it has the mean of the known ones, or in a hole of all.

    `shrink_known` of floats takes three times as long.
    """
    if times == 1:
        return values, hole, label
    more = [-size % times for size in hole.shape]
    values, known = (
        cv2.copyMakeBorder(one, 0, more[0], 0, more[1], cv2.BORDER_REPLICATE)
        for one in (values, (~hole).view(np.uint8))
    )
    size = known.shape[1] // times, known.shape[0] // times
    share, means, sums = (
        cv2.resize(one, size, interpolation=cv2.INTER_AREA)
        for one in (known.astype(np.float32), values, cv2.copyTo(values, known))
    )
    smaller = share < 0.5
    known_means = sums / np.maximum(share, 0.5)[..., None]
    if values.dtype == np.uint8:
        known_means = np.minimum(np.rint(known_means), 255)
    return replace_pixels(known_means.astype(values.dtype), smaller, means), smaller, label[::times, ::times]


def build_pyramid(picture: UInt8Array, hole: BoolArray, label: NDArray[np.integer]) -> list[Level]:
    """Levels from the picture itself to the coarsest, each half of the one before.

    picture: H x W x 3 RGB, a guess in the hole (H x W). The last level is the first in which the hole is no deeper than 8 px, or
    the last in which enough whole patches are known. In a deeper hole the guess has too much weight; in a shallower one its
    structure is lost.
    """
    values = describe_pixels(picture, hole)
    levels = [Level(values, hole, whole_patches(hole), label.astype(np.int32))]
    while hole_depth(hole) > 8 and min(hole.shape) >= 40:
        values, hole, label = shrink(values, hole, label, 2)
        sources = whole_patches(hole)
        if sources.sum() < 50 or not hole.any():
            break
        levels.append(Level(values, hole, sources, label.astype(np.int32)))
    return levels


def describe_pixels(picture: UInt8Array, hole: BoolArray) -> Float32Array:
    """H x W x 5, as of `describe_known`: of the known picture, and in the hole of the guess there."""
    values = describe_known(picture, ~hole)
    if hole.any():
        box = box_around(hole, TEXTURE_PX)
        paste(describe_known(picture[box], np.ones_like(hole[box])), hole[box], values[box])
    return values


def describe_known(picture: UInt8Array, known: BoolArray) -> Float32Array:
    """H x W x 5 in known pixels: colours (0 .. 255), and TEXTURE times the mean change of brightness between known neighbours."""
    red, green, blue = (picture[..., k].astype(np.float32) for k in range(3))
    brightness, side = (red + green + blue) / np.float32(3), (TEXTURE_PX, TEXTURE_PX)
    share = np.maximum(cv2.blur(known.astype(np.float32), side), np.float32(1e-6))
    out = np.empty((*known.shape, 5), np.float32)
    out[..., :3] = picture
    for channel, here, before in ((3, np.s_[:, 1:], np.s_[:, :-1]), (4, np.s_[1:], np.s_[:-1])):
        change = np.zeros_like(brightness)
        change[here] = np.abs(brightness[here] - brightness[before]) * (known[here] & known[before])
        out[..., channel] = np.float32(TEXTURE) * cv2.blur(change, side) / share
    return out


def whole_patches(hole: BoolArray) -> BoolArray:
    """H x W, True in the centres of patches inside the picture and outside the hole."""
    out = ~dilate_by_patch(hole)
    out[: kernels.HALF] = out[-kernels.HALF :] = False
    out[:, : kernels.HALF] = out[:, -kernels.HALF :] = False
    return out


def dilate_by_patch(hole: BoolArray) -> BoolArray:
    """H x W, True in the centres of patches that overlap the hole."""
    return dilate_square(hole, 2 * kernels.HALF + 1)


def hole_depth(hole: BoolArray) -> float:
    """Distance in px of the hole's innermost pixel from known ones; beyond the border nothing is known."""
    wider = cv2.copyMakeBorder(hole.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    return float(cv2.distanceTransform(wider, cv2.DIST_L2, 3).max())
