"""Connected pieces of a picture, and some of them, in; the pieces that form one object with them out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import nearest_known
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.perception.masks.prompt import Pixel

OBJECT_GAP = 0.15
"""Largest relative depth difference of touching pieces of one object: a lamp's shade hangs before its pole."""
GROUP_GAP = 0.3
"""The same for a group of objects."""
TOUCHING_PX = 3
MOSTLY = 0.95
"""Share of the common border with similar depths that joins two pieces. A stool before a bed touches it at its ground contact
alone, a vase what lies behind the edge of its plinth."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """The picture without its supporting planes, in connected pieces."""

    depth: Float32Array
    free: BoolArray
    """H x W, True where depth is valid and on no supporting plane."""
    label: NDArray[np.int32]
    """H x W number of each pixel's piece; undefined where not free."""
    support: BoolArray
    """H x W, True on supporting planes."""

    def at(self, pixel: Pixel) -> BoolArray:
        """H x W, True on the piece at a pixel; all False where there is none."""
        return self.free & (self.label == self.label[pixel]) & bool(self.free[pixel])

    def at_any(self, pixels: list[Pixel]) -> BoolArray:
        """H x W, True on the pieces at pixels."""
        return sum((self.at(pixel) for pixel in pixels), np.zeros(self.free.shape, np.bool_))


def merge_pieces(pieces: Pieces, start: BoolArray, gap: float, barred: set[int]) -> BoolArray:
    """`start` and, repeatedly, all pieces that belong to it. gap 0: `start` alone.

    gap: largest relative depth difference of touching pieces. barred: numbers of pieces to leave out.
    """
    target = start.copy()
    while gap:
        chosen = [n for n in find_touching(pieces, target, gap) if n not in barred]
        if not chosen:
            break
        target |= pieces.free & np.isin(pieces.label, chosen)
    return target


def find_touching(pieces: Pieces, target: BoolArray, gap: float) -> list[int]:
    """Numbers of the pieces whose common border with `target` (H x W) has mostly similar depths."""
    distance, nearest = nearest_known(target)
    border = pieces.free & ~target & (distance <= TOUCHING_PX + 0.5)
    pixels = np.flatnonzero(border)
    depth = pieces.depth.ravel()
    here, there = depth[pixels], depth[nearest.ravel()[pixels]]
    numbers, which = np.unique(pieces.label.ravel()[pixels], return_inverse=True)
    close = np.bincount(which, np.abs(here - there) <= gap * np.minimum(here, there), len(numbers))
    lengths = np.bincount(which, minlength=len(numbers))
    return [int(n) for n in numbers[(close > 1) & (close >= MOSTLY * lengths)]]
