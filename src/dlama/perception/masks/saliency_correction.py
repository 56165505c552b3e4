"""A mask found in a depth camera's depth in; the mask corrected by a salient-object network out.

The network of `salient` runs in a window about the mask. Where both show one object, each surface mostly inside the salient
region belongs to it (the seat of a chair, which depth alone takes for a support). Surfaces mostly outside belong to another
object (a table that touches the chair in the picture). Where depth hardly steps along the outline, as of a book against a wall,
the salient region at the click decides alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.errors import MaskError
from dlama.geometry.holes import dilate_mask, disc, erode_mask, morphological_open, nearest_known
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.masks.borders import HOLE_PX
from dlama.perception.masks.pieces import OBJECT_GAP, Pieces
from dlama.perception.masks.prompt import Pixel, Prompt
from dlama.perception.masks.salient import saliency
from dlama.perception.masks.supports import Planes

WINDOW = 1.8
"""Side of the window about the mask, over its longer side; SMALLEST_WINDOW px at least."""
SMALLEST_WINDOW = 64
CLICK_WINDOWS = (0.5, 0.25)
"""Sides of windows about a click alone, over the root of the picture's area."""
CLICK_PX = 3
"""Radius in px in which a click selects a salient region."""
BELONGS, OTHER = 0.6, 0.35
"""Salient share of a surface from which it belongs to the object, and up to which it does not,"""
THIN_PX = 6
"""if it is wider than twice this: thin legs are not salient."""
SAME_OBJECT = 0.7
"""Least intersection over union of the salient region and its surfaces for both to show one object."""
APART = 4
FLAT = 0.025
"""Median relative depth step along an outline below which depth does not define the object's border."""
CONFIDENT, CUT_OFF = 0.9, 0.02
"""Least saliency of a region at a click alone, and largest share of the window's border that it may cross."""


@dataclass(frozen=True, eq=False)
class SalientObject:
    """The salient region of a window at the clicks."""

    level: Float32Array
    """H x W, 0..1; 0 outside the window."""
    part: BoolArray
    """H x W, True where saliency exceeds one half and is connected with a click."""
    cut: float
    """Share of the window's border, inside the picture, that the region crosses."""


@dataclass(frozen=True, eq=False)
class CorrectedMask:
    """A mask from depth and saliency."""

    target: BoolArray
    """H x W."""
    shown: SalientObject | None
    """The salient region, where both show one object."""


def correct_by_saliency(rgbd: RGBD, found: Planes, pieces: Pieces, target: BoolArray, prompt: Prompt) -> CorrectedMask:
    """The mask of depth (H x W), corrected by the salient region; unchanged where that shows something else."""
    shown = find_salient(rgbd.color, square_around_mask(target), prompt)
    best, agreed = (target, 0.0) if shown is None else select_surfaces(rgbd, found, pieces, target, shown)
    if agreed >= SAME_OBJECT:
        return CorrectedMask(best, shown)
    if shown is None or depth_step_at_outline(rgbd, target) < FLAT:
        alone = find_salient_at_click(rgbd.color, prompt)
        if alone is not None:
            return CorrectedMask(alone.part, alone)
    return CorrectedMask(target, None)


def find_unknown_pixels(rgbd: RGBD, mask: BoolArray, shown: SalientObject | None) -> BoolArray:
    """H x W, True on missing depth near a mask (H x W), farther out where salient."""
    unknown = rgbd.missing & dilate_mask(mask, HOLE_PX)
    return unknown if shown is None else unknown | (shown.part & rgbd.missing & dilate_mask(mask, 2 * HOLE_PX))


def find_salient_at_click(color: UInt8Array, prompt: Prompt) -> SalientObject | None:
    """A region of high saliency in a window about the first click that the window does not cut off."""
    height, width = color.shape[:2]
    for share in CLICK_WINDOWS:
        side = round(share * float(np.sqrt(height * width)))
        window = square_around_pixel(Prompt.pixels(prompt.clicks)[0], side, (height, width))
        alone = find_salient(color, window, prompt)
        if alone is not None and alone.cut <= CUT_OFF and float(alone.level[alone.part].mean()) >= CONFIDENT:
            return alone
    return None


def overlap(one: BoolArray, other: BoolArray) -> float:
    """Intersection over union, 0..1."""
    return float((one & other).sum() / max((one | other).sum(), 1))


def select_surfaces(
    rgbd: RGBD, found: Planes, pieces: Pieces, target: BoolArray, shown: SalientObject
) -> tuple[BoolArray, float]:
    """H x W, the surfaces that belong to the salient region; and their agreement with it, 0..1, without missing depth near by.

    A surface that depth left out must be as near as the object next to it. Of a plane most must be salient: what is seen
    through a chair's back is no part of it.
    """
    number = number_surfaces(found, pieces)
    count = int(number.max()) + 1
    sizes, held, had = (
        np.bincount(number[where].ravel(), minlength=count)
        for where in (rgbd.valid, rgbd.valid & shown.part, rgbd.valid & target)
    )
    share, was = held / np.maximum(sizes, 1), had / np.maximum(sizes, 1) >= 0.5
    here, there = rgbd.depth, rgbd.depth.ravel()[nearest_known(target & rgbd.valid)[1]]
    near = rgbd.valid & (np.abs(here - there) <= OBJECT_GAP * np.minimum(here, there))
    close = np.bincount(number[near], minlength=count) >= 0.5 * sizes
    plane = np.zeros(count, np.intp)
    plane[number] = np.maximum(found.label, 0)
    of_plane = np.array([1.0, *(found.share(n, shown.part) for n in range(len(found.planes)))])
    added = ~was & close & (share >= BELONGS) & (of_plane[plane] >= BELONGS)
    solid = np.bincount(number[morphological_open(target, disc(THIN_PX))], minlength=count) >= 0.5 * sizes
    other = (share <= OTHER) & solid
    chosen = ((was & ~other) | added)[number] & rgbd.valid
    return chosen, overlap(chosen, shown.part & ~(rgbd.missing & dilate_mask(target, 2 * HOLE_PX)))


def number_surfaces(found: Planes, pieces: Pieces) -> NDArray[np.int32]:
    """H x W number of each pixel's surface: connected parts of planes, and pieces on no plane."""
    out, first = np.zeros(pieces.depth.shape, np.int32), 1
    for plane in range(1, len(found.planes) + 1):
        count, labels = cv2.connectedComponents((found.label == plane).astype(np.uint8), connectivity=4)
        out = np.where(labels > 0, labels + (first - 1), out)
        first += count - 1
    rest = pieces.free & (found.label < 1)
    _, numbers = np.unique(pieces.label[rest], return_inverse=True)
    out[rest] = first + numbers
    return np.asarray(out, np.int32)


def depth_step_at_outline(rgbd: RGBD, target: BoolArray) -> float:
    """Median relative step of depth across the outline of a mask (H x W), of means over APART px; 0 where none is known."""
    window = (2 * APART + 1, 2 * APART + 1)
    means = []
    for where in (rgbd.valid & target, rgbd.valid & ~target):
        count = cv2.boxFilter(where.astype(np.float32), -1, window, normalize=False)
        total = cv2.boxFilter(np.where(where, rgbd.depth, np.float32(0)), -1, window, normalize=False)
        means.append(np.where(count > APART, total / np.maximum(count, 1), np.nan))
    steps = (means[1] / means[0])[target & ~erode_mask(target, 1)]
    known = steps[np.isfinite(steps)]
    return float(np.median(np.abs(known - 1))) if known.size else 0.0


def square_around_mask(target: BoolArray) -> tuple[slice, slice]:
    """The square about a mask (H x W)."""
    rows, columns = np.flatnonzero(target.any(1)), np.flatnonzero(target.any(0))
    side = max(SMALLEST_WINDOW, round(WINDOW * max(int(np.ptp(rows)), int(np.ptp(columns)))))
    middle = int(rows[0] + rows[-1]) // 2, int(columns[0] + columns[-1]) // 2
    return square_around_pixel(middle, side, target.shape)


def square_around_pixel(pixel: Pixel, side: int, hw: tuple[int, ...]) -> tuple[slice, slice]:
    """Rows and columns of the square about a pixel, as far as it lies in the picture."""
    first = [max(at - side // 2, 0) for at in pixel]
    last = [min(at + side // 2 + 1, length) for at, length in zip(pixel, hw)]
    return slice(first[0], last[0]), slice(first[1], last[1])


def find_salient(color: UInt8Array, window: tuple[slice, slice], prompt: Prompt) -> SalientObject | None:
    """The salient region of a window at the clicks; None where there is none, or where it contains a negative click."""
    try:
        within = saliency(np.ascontiguousarray(color[window]))
    except MaskError:
        return None
    level = np.zeros(color.shape[:2], np.float32)
    level[window] = within
    _, labels = cv2.connectedComponents((level > 0.5).astype(np.uint8), connectivity=8)
    chosen = set[int]()
    for row, column in Prompt.pixels(prompt.clicks):
        near = labels[max(row - CLICK_PX, 0) : row + CLICK_PX + 1, max(column - CLICK_PX, 0) : column + CLICK_PX + 1]
        counts = np.bincount(near.ravel())
        counts[0] = 0
        if not counts.any():
            return None
        chosen.add(int(counts.argmax()))
    part = np.isin(labels, list(chosen))
    if any(part[pixel] for pixel in Prompt.pixels(prompt.not_clicks)):
        return None
    return SalientObject(level, part, rim_share(part, window))


def rim_share(mask: BoolArray, window: tuple[slice, slice]) -> float:
    """Border pixels of the window, inside the picture, that a mask crosses, over the window's longer side."""
    part, (rows, columns) = mask[window], window
    sides = (
        (rows.start > 0, part[0]),
        (rows.stop < mask.shape[0], part[-1]),
        (columns.start > 0, part[:, 0]),
        (columns.stop < mask.shape[1], part[:, -1]),
    )
    return sum(int(line.sum()) for inner, line in sides if inner) / max(part.shape)
