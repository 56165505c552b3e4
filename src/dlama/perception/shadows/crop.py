"""An object's mask in; the crop of the picture in which its shadow is searched out, and the way back."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dlama.geometry.holes import box_around, sides_of
from dlama.geometry.rgbd import BoolArray, Float32Array

SIDE = 320
"""Longer side of the crop in its own pixels."""


@dataclass(frozen=True)
class Crop:
    """The part of a picture in which a shadow is searched."""

    rows: slice
    columns: slice
    scale: float
    """Pixels of the crop in one of the picture."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the crop; what lies right of it and below is empty."""
        wide, high = self.columns.stop - self.columns.start, self.rows.stop - self.rows.start
        return min(SIDE, max(1, round(wide * self.scale))), min(SIDE, max(1, round(high * self.scale)))

    def small(self, picture: np.ndarray) -> np.ndarray:
        """The crop of a picture (H x W or H x W x 3) at the crop's size, float32."""
        part = np.ascontiguousarray(picture[self.rows, self.columns]).astype(np.float32)
        how = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_LINEAR
        return cv2.resize(part, self.size, interpolation=how)

    def large(self, plane: Float32Array, hw: tuple[int, int]) -> Float32Array:
        """A plane of the crop at its place in a picture of H x W; 0 outside the crop."""
        wide, high = self.size
        return self.place(plane[:high, :wide], hw)

    def place(self, plane: Float32Array, hw: tuple[int, int]) -> Float32Array:
        """A plane that covers just the crop, of any size, in a picture of H x W; 0 outside the crop."""
        out = np.zeros(hw, np.float32)
        box = out[self.rows, self.columns]
        box[:] = cv2.resize(plane, box.shape[::-1], interpolation=cv2.INTER_LINEAR)
        return out


def crop_around(mask: BoolArray) -> Crop:
    """The crop in which an object's shadow is searched; margins in diagonals of the object: 1.6 aside, 1.2 below, 0.5 above."""
    rows, columns = tight = box_around(mask, 0)
    height, width = mask.shape
    diagonal = float(np.hypot(*sides_of(tight))) + 8
    top, bottom = max(0, int(rows.start - 0.5 * diagonal)), min(height, int(rows.stop + 1.2 * diagonal))
    left, right = max(0, int(columns.start - 1.6 * diagonal)), min(width, int(columns.stop + 1.6 * diagonal))
    scale = min(2.0, SIDE / max(bottom - top, right - left))
    return Crop(slice(top, bottom), slice(left, right), scale)
