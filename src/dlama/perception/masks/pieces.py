"""Connected pieces of a picture, and some of them, in; the pieces that form one object with them out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import dilate_mask, nearest_known
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.perception.masks.prompt import Pixel

OBJECT_GAP = 0.15
"""Largest relative depth difference of touching pieces of one object: a lamp's shade hangs before its pole."""
GROUP_GAP = 0.3
"""The same for a group of objects."""
TOUCHING_PX = 3
LARGER = 3.0
"""A piece so many times larger than the clicked one, which also covers LARGE_SHARE, is another object."""
LARGE_SHARE = 0.05
MOSTLY = 0.5
"""Share of the common border with similar depths that joins two pieces. A stool before a bed touches it at its ground contact
alone."""
SOME_COLOR = 0.15
"""Common colours of two pieces from which a smaller share of the border is enough,"""
SAME_COLOR = 0.25
"""and from which a smaller piece farther behind belongs to the object (the hind leg of a chair),"""
SMALLER = 0.25
"""if it has at most this share of the object's pixels,"""
BEHIND_SIZE = 0.4
"""and lies behind it by at most this share of its size."""
CRACK_COLOR = 0.5
"""Common colours of two pieces on both sides of a crack: the leaves of a folding screen."""
CRACK_SIZE = 0.05
"""Largest width of a crack, over the size of the pieces,"""
CRACK_SHARE = 1 / 64
"""and over the picture's longer side,"""
CRACK_LENGTH = 0.25
"""and its least length over the piece's longer side."""
SMALL_SHARE = 0.05
"""A piece with less than this share of the object's pixels may touch it anywhere (a spoke before the ground),"""
"""or lie within its outline at a similar depth: fragments of a spoke thinner than a pixel."""
LEAST_PX = 40
"""A piece with fewer pixels has no colours of its own."""


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
    bins: NDArray[np.int32]
    """H x W coarse colour, see `color_bins`."""
    focal: float
    """px."""

    def at(self, pixel: Pixel) -> BoolArray:
        """H x W, True on the piece at a pixel; all False where there is none."""
        return self.free & (self.label == self.label[pixel]) & bool(self.free[pixel])

    def at_any(self, pixels: list[Pixel]) -> BoolArray:
        """H x W, True on the pieces at pixels."""
        return sum((self.at(pixel) for pixel in pixels), np.zeros(self.free.shape, np.bool_))

    def size_of(self, where: BoolArray) -> float:
        """Diagonal in metres of a region (H x W), as if it were upright."""
        rows, columns = np.nonzero(where)
        return float(np.median(self.depth[where]) / self.focal * np.hypot(np.ptp(rows), np.ptp(columns)))

    def common_color(self, one: BoolArray, other: BoolArray) -> float:
        """Common share (0..1) of the colours of two regions: intersection of histograms (Swain & Ballard 1991)."""
        shares = [np.bincount(self.bins[where], minlength=BINS) / max(int(where.sum()), 1) for where in (one, other)]
        return float(np.minimum(*shares).sum())


BINS = 10 * 16 * 16


def color_bins(color: UInt8Array) -> NDArray[np.int32]:
    """H x W: which of BINS boxes of CIELAB each colour is in."""
    lab = cv2.cvtColor(color, cv2.COLOR_RGB2LAB).astype(np.int32)
    return np.asarray((lab[..., 0] * 10 // 256 * 16 + lab[..., 1] // 16) * 16 + lab[..., 2] // 16, np.int32)


def merge_pieces(pieces: Pieces, start: BoolArray, gap: float, barred: set[int]) -> BoolArray:
    """`start` and, repeatedly, all pieces that belong to it. gap 0: `start` alone.

    gap: largest relative depth difference of touching pieces. barred: numbers of pieces to leave out.
    """
    target, size = start.copy(), pieces.size_of(start)
    sizes = np.bincount(pieces.label[pieces.free], minlength=target.size)
    while gap:
        most = max(LARGER * target.sum(), LARGE_SHARE * target.size)
        chosen = [n for n in find_belonging(pieces, target, gap, size, sizes) if n not in barred and sizes[n] <= most]
        if not chosen:
            break
        target |= pieces.free & np.isin(pieces.label, chosen)
    return target


def find_belonging(
    pieces: Pieces, target: BoolArray, gap: float, size: float, sizes: NDArray[np.int64]
) -> Iterator[int]:
    """Numbers of the pieces that form one object with `target` (H x W): they touch it, lie close behind it, or across a crack.

    size: metres, of the clicked piece. sizes: pixels of each piece.
    """
    reach = max(TOUCHING_PX, round(CRACK_SHARE * max(target.shape)))
    distance, nearest = nearest_known(target)
    yield from find_enclosed(pieces, target, gap, sizes, nearest)
    pixels = np.flatnonzero(dilate_mask(target, reach) & pieces.free & ~target)
    away, depth = distance.ravel()[pixels], pieces.depth.ravel()
    here, there = depth[pixels], depth[nearest.ravel()[pixels]]
    step, nearer = np.abs(here - there), np.minimum(here, there)
    labels = pieces.label.ravel()[pixels]
    for number in np.unique(labels).tolist():
        of_it = labels == number
        border = of_it & (away <= TOUCHING_PX + 0.5)
        close = int((step <= gap * nearer)[border].sum())
        if close > 1 and (sizes[number] < SMALL_SHARE * target.sum() or close >= MOSTLY * border.sum()):
            yield number
            continue
        if sizes[number] < LEAST_PX:
            continue
        piece = pieces.free & (pieces.label == number)
        common = pieces.common_color(target, piece)
        behind = border & (step <= BEHIND_SIZE * size)
        crack = of_it & (np.hypot(step, away * nearer / pieces.focal) <= CRACK_SIZE * size)
        if (
            (close > 1 and common >= SOME_COLOR)
            or (behind.sum() > 1 and common >= SAME_COLOR and sizes[number] <= SMALLER * target.sum())
            or (common >= CRACK_COLOR and crack.sum() >= CRACK_LENGTH * longer_side(piece))
        ):
            yield number


def find_enclosed(
    pieces: Pieces, target: BoolArray, gap: float, sizes: NDArray[np.int64], nearest: NDArray[np.int64]
) -> list[int]:
    """Numbers of the small pieces within the outline of `target` (H x W) at its depth.

    sizes: pixels of each piece. nearest: H x W flat index of the nearest pixel of the object.
    """
    pixels = np.flatnonzero(fill_outline(target) & pieces.free & ~target)
    labels, depth = pieces.label.ravel()[pixels], pieces.depth.ravel()
    here, there = depth[pixels], depth[nearest.ravel()[pixels]]
    near = labels[np.abs(here - there) <= gap * np.minimum(here, there)]
    numbers, counts = np.unique(near, return_counts=True)
    return [int(n) for n in numbers[(counts == sizes[numbers]) & (counts < SMALL_SHARE * target.sum())]]


def fill_outline(where: BoolArray) -> BoolArray:
    """A region (H x W) with its holes filled."""
    outlines, _ = cv2.findContours(where.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(np.zeros(where.shape, np.uint8), outlines, -1, 1, cv2.FILLED) > 0)


def longer_side(where: BoolArray) -> int:
    """Longer side in px of the bounding box of a region."""
    rows, columns = np.nonzero(where)
    return int(max(np.ptp(rows), np.ptp(columns))) + 1
