"""A painter, and a picture with a hole, in; a coarse guess, as the start of the patch search, out."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import shrink_known
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.inpainters.filling import Paint
from dlama.models.network_file import make_room

GUESS_SIDE = 768
"""Longer side in pixels of the picture that the painter sees: detail comes from patches."""


def guess_coarsely(paint: Paint, picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
    """H x W x 3: the picture (H x W x 3 RGB) with its hole (H x W) as painted at GUESS_SIDE pixels at most."""
    height, width = hole.shape
    by = GUESS_SIDE / max(height, width)
    if by >= 1:
        return paint(picture, hole, seed)
    size = max(1, round(width * by)), max(1, round(height * by))
    means, share = shrink_known(picture, ~hole, size)
    small = np.clip(np.round(means), 0, 255).astype(np.uint8)
    painted = cv2.resize(paint(small, share < 0.5, seed), (width, height), interpolation=cv2.INTER_CUBIC)
    make_room(hole.size)
    return np.where(hole[..., None], painted, picture)
