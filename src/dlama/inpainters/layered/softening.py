"""Softening: painted colours out of view in; the same, with borders between surfaces drawn as wide as they are unsure, out.

Nobody can know where a wall ends that the picture does not show. Near what is known the painted borders are sharp; farther off
they are blurred over a share of that distance.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

WIDTH = 0.05
"""Sigma of the blur over the distance from what is known."""
SHARP = 0.01
"""Share of the picture's longer side up to which borders beside what is known stay as sharp as they are."""
REACH = 2.0
"""Sigmas from a border within which colours are blurred; less and less from one on."""
DETAIL = 12.0
"""Grey levels of fine detail that stay, away from borders."""
FINE_PX, BORDER_PX = 2.0, 4.0
"""What is finer than the first is detail; what is nearer to a border than the second is the border's own."""

MARGIN_PX = 32
"""What is looked at beside what is blurred."""


def softened(color: UInt8Array, hole: BoolArray, unseen: BoolArray, label: NDArray[np.int32]) -> UInt8Array:
    """H x W x 3 colours, blurred round borders between surfaces in the hole pixels that are `unseen`.

    color: H x W x 3, painted; hole, unseen: H x W; label: H x W, the surface of each pixel.
    """
    border = borders(label) & hole & unseen
    if not border.any() or hole.all():
        return color
    distance = cv2.distanceTransform(hole.astype(np.uint8), cv2.DIST_L2, 5)
    away = cv2.distanceTransform((~border).astype(np.uint8), cv2.DIST_L2, 5)
    sigma = WIDTH * np.maximum(distance - SHARP * max(hole.shape), 0) * (hole & unseen)
    sigma *= np.clip(REACH - away / np.maximum(sigma, 1e-3), 0, 1)
    level = (np.log2(np.maximum(sigma, 1)) + np.minimum(sigma, 1)).astype(np.float32)
    if level.max() == 0:
        return color
    rows, columns = (np.flatnonzero(level.any(axis)) for axis in (1, 0))
    box = tuple(slice(max(0, ends[0] - MARGIN_PX), ends[-1] + MARGIN_PX + 1) for ends in (rows, columns))
    picture, level, away = color[box].astype(np.float32), level[box], away[box]
    detail = np.clip(picture - cv2.GaussianBlur(picture, (0, 0), FINE_PX), -DETAIL, DETAIL)
    kept = np.clip(away / BORDER_PX - 1, 0, 1) * np.clip(level, 0, 1)
    soft = blurred_by_level(picture, level) + detail * kept[..., None]
    out = color.copy()
    out[box] = np.clip(np.round(soft), 0, 255)
    return out


def borders(label: NDArray[np.int32]) -> BoolArray:
    """H x W, True where the left or the upper neighbour has another label."""
    out = np.zeros(label.shape, np.bool_)
    out[:, 1:] |= label[:, 1:] != label[:, :-1]
    out[1:] |= label[1:] != label[:-1]
    return out


def blurred_by_level(picture: Float32Array, level: Float32Array) -> Float32Array:
    """H x W x 3 colours, each pixel from its level (H x W, 0 = as it is) of the Gaussian pyramid, between two levels linearly."""
    pyramid, out, finer = [picture], picture.copy(), picture
    for number in range(int(np.ceil(level.max()))):
        pyramid.append(np.asarray(cv2.pyrDown(pyramid[-1]), np.float32))
        coarser = pyramid[-1]
        for size in reversed(pyramid[:-1]):
            coarser = np.asarray(cv2.pyrUp(coarser, dstsize=size.shape[1::-1]), np.float32)
        out += np.clip(level - number, 0, 1)[..., None] * (coarser - finer)
        finer = coarser
    return out
