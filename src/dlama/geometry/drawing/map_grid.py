"""A depth map, possibly enlarged to its picture's size, in; its original pixel grid out."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

ENLARGED = 1.25
"""Least number of picture pixels to one pixel of an enlarged map."""
LEAST_BORDERS, REGULAR = 40, 0.8
"""Least number of borders; least share of their distances that are equal (to a pixel) in an enlarged map."""


class MapAxis(NamedTuple):
    """The pixels of a depth map along one side of the picture that it was enlarged to."""

    sides: int
    """Pixels of the picture."""
    pixel: float
    """Pixels of the picture to one of the map; 1: the map was not enlarged."""

    @classmethod
    def of(cls, changes: BoolArray) -> MapAxis:
        """From positions where depth changes: in an enlarged map they are a constant distance apart (to a pixel)."""
        sides = len(changes) + 1
        between = np.diff(np.flatnonzero(changes))
        if len(between) < LEAST_BORDERS:
            return cls(sides, 1.0)
        usual = between <= np.median(between) + 1
        steps = np.rint(between / between[usual].mean())  # where depth does not change a border is missing
        pixel = float(between.sum() / max(steps.sum(), 1))
        return cls(sides, pixel if pixel >= ENLARGED and usual.mean() > REGULAR else 1.0)

    @property
    def middles(self) -> NDArray[np.intp]:
        """The pixel of the picture in the middle of each of the map."""
        number = np.arange(round(self.sides / self.pixel))
        return ((number + 0.5) * (self.sides / len(number))).astype(np.intp)

    @property
    def owners(self) -> NDArray[np.intp]:
        """The pixel of the map that each of the picture lies in."""
        return (np.arange(self.sides) * round(self.sides / self.pixel) // self.sides).astype(np.intp)


class MapGrid(NamedTuple):
    """The pixels of a depth map that may have been enlarged to the size of its picture by the nearest pixel."""

    rows: MapAxis
    columns: MapAxis

    @classmethod
    def of(cls, depth: Float32Array) -> MapGrid:
        """The grid of depth (H x W), by its blocks of equal values."""
        return cls(MapAxis.of((depth[1:] != depth[:-1]).any(1)), MapAxis.of((depth[:, 1:] != depth[:, :-1]).any(0)))

    @property
    def largest(self) -> float:
        """Pixels of the picture to one of the map, along the side where they are more."""
        return max(self.rows.pixel, self.columns.pixel)

    @property
    def enlarged(self) -> bool:
        """Whether the map was enlarged."""
        return self.largest > 1

    def sample_map(self, values: np.ndarray) -> np.ndarray:
        """Values of the picture (H x W) at the pixels of the map; unchanged where it was not enlarged."""
        return values[self.rows.middles][:, self.columns.middles] if self.enlarged else values

    def picture(self, color: UInt8Array) -> UInt8Array:
        """The picture (H x W x 3) at the size of the map."""
        if not self.enlarged:
            return color
        size = len(self.columns.middles), len(self.rows.middles)
        return np.asarray(cv2.resize(color, size, interpolation=cv2.INTER_AREA), np.uint8)

    def enlarge(self, values: np.ndarray) -> np.ndarray:
        """Values of the map at the pixels of the picture."""
        return values[self.rows.owners][:, self.columns.owners]
