"""A frame in -> a random square of it, resized to a sample's size, out: the same square of colour, depth, mask and disparity.

Colour is averaged over areas; depth and disparity are the nearest pixel's, since a mean of two surfaces lies on neither; a mask
keeps every pixel that it touches, so that no part of the masked object is left outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.resampling import nearest_pixels

SMALLEST_CROP = 0.7
"""Least side of a crop, as a share of the frame's smaller side."""


@dataclass(frozen=True)
class Crop:
    """`side` x `side` pixels of a frame, which become `size` x `size`."""

    top: int
    left: int
    side: int
    size: int

    def rgbd(self, rgbd: RGBD) -> RGBD:
        """The crop of a frame, with the camera of the crop."""
        part, camera = self._part, rgbd.camera.cropped(self.left, self.top, self.side, self.side)
        return resize_frame(RGBD(rgbd.color[part], rgbd.depth[part], camera), self.size / self.side)

    def color(self, color: UInt8Array) -> UInt8Array:
        """H x W x 3 -> size x size x 3."""
        return resize_color(color[self._part], (self.size, self.size))

    def mask(self, mask: BoolArray) -> BoolArray:
        """H x W -> size x size, True wherever any of it was."""
        part, size = mask[self._part], (self.size, self.size)
        if self.size >= self.side:
            return nearest_pixels(part, size)
        return np.asarray(cv2.resize(part.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 1e-6)

    def disparity(self, disparity: Float32Array) -> Float32Array:
        """H x W px, 0 = unknown -> size x size, in pixels of the sample."""
        part = nearest_pixels(disparity[self._part], (self.size, self.size))
        return (part * np.float32(self.size / self.side)).astype(np.float32)

    @property
    def _part(self) -> tuple[slice, slice]:
        return np.s_[self.top : self.top + self.side, self.left : self.left + self.side]


def random_crop(hw: tuple[int, int], size: int, rng: np.random.Generator, around: BoolArray | None = None) -> Crop:
    """A random square of a frame of height and width `hw`, to be resized to `size` px; with `around` (H x W) one that has a pixel
    of `around` in it."""
    height, width = hw
    side = round(min(hw) * rng.uniform(SMALLEST_CROP, 1))
    lowest, highest = (0, 0), (height - side, width - side)
    if around is not None and around.any():
        rows, columns = np.nonzero(around)
        chosen = int(rng.integers(len(rows)))
        at = int(rows[chosen]), int(columns[chosen])
        lowest = max(at[0] - side + 1, 0), max(at[1] - side + 1, 0)
        highest = min(at[0], highest[0]), min(at[1], highest[1])
    top, left = (int(rng.integers(low, high + 1)) for low, high in zip(lowest, highest))
    return Crop(top, left, side, size)


def resize_frame(rgbd: RGBD, factor: float) -> RGBD:
    """A frame with `factor` times as many pixels a side (rounded)."""
    height, width = (max(1, round(side * factor)) for side in rgbd.camera.hw)
    color, depth = resize_color(rgbd.color, (height, width)), nearest_pixels(rgbd.depth, (height, width))
    return RGBD(color, depth, rgbd.camera.resized(width, height))


def resize_color(color: UInt8Array, hw: tuple[int, int]) -> UInt8Array:
    """H x W x 3 at another height and width: area means, or linear where it grows."""
    how = cv2.INTER_AREA if hw[0] < color.shape[0] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(color, hw[::-1], interpolation=how), np.uint8)
