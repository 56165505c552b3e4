"""Photos and worlds in -> pictures with a hole, and what belongs there, for tuning the painter (`painter`), out.

Photos get holes of the outlines of other photos' salient objects, or a strip beside one, as a moved camera uncovers; the truth is
the photo. Worlds get an object removed; the truth is the world without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from dlama.errors import MaskError
from dlama.files.atomic_write import new_file
from dlama.geometry.holes import box_around, dilate_square
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.perception.masks.salient import saliency
from dlama.training.data.photos import Photo, square_crop
from dlama.training.data.samples.world_views import WorldSet
from world_cases import world_case

WORLD_SIDE, STORED_SIDE, AROUND = 512, 384, 60
"""Pixels of a world's picture, and of the square of it that is kept; their middles are at most so far apart."""
FIRST_WORLD = 50_000
OUTLINE_SHARES, HOLE_SHARES = (0.02, 0.6), (0.01, 0.4)
"""Of a photo, that an object covers whose outline is kept; of a crop."""
LONGER_SIDES = 0.12, 0.75
"""Of an outline in a crop, in sides of the crop."""
TWO, STRIPS, WHOLE = 0.3, 0.2, 0.4
"""Shares of holes of two outlines, of outlines that become strips, of worlds that are made smaller rather than cut."""
PHOTO_GROWTH, WORLD_GROWTH = (1, 7), (3, 12)
"""Sides in pixels, the last one excluded, of squares that holes are dilated by."""
BRIGHTER, TINTED = (0.75, 1.2), (0.93, 1.07)
"""Factors on all channels and on each."""


class Crop(NamedTuple):
    """A square picture with a hole."""

    color: Float32Array
    """S x S x 3 RGB, 0..255; what it shows in the hole counts for nothing."""
    truth: Float32Array
    """The same as it is without what the hole hides."""
    hole: BoolArray
    """S x S."""


def outlines_of(photos: Sequence[Photo]) -> list[BoolArray]:
    """The largest piece of the most salient object of each photo that has a fitting one, in its box."""
    found = []
    for photo in photos:
        try:
            salient = saliency(photo.load()) > 0.5
        except MaskError:
            continue
        _, pieces, stats, _ = cv2.connectedComponentsWithStats(salient.astype(np.uint8))
        if len(stats) < 2:
            continue
        object_ = pieces == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
        if OUTLINE_SHARES[0] < object_.mean() < OUTLINE_SHARES[1]:
            found.append(np.ascontiguousarray(object_[box_around(object_, 0)]))
    return found


def write_worlds(folder: Path, count: int, photos: Sequence[Photo]) -> None:
    """Squares of worlds with an object and without it, and its mask; every other world has photos as textures. OutputError."""
    folder.mkdir(parents=True, exist_ok=True)
    rng, sets = np.random.default_rng(1), [WorldSet("train", WORLD_SIDE, tuple(photos)), WorldSet("train", WORLD_SIDE)]
    for number in range(count):
        case = world_case(FIRST_WORLD + number, "removal", "exact", sets[number % 2])
        rows, columns = box_around(case.mask, 0)
        top, left = (
            int(np.clip((side.start + side.stop - STORED_SIDE) // 2 + off, 0, WORLD_SIDE - STORED_SIDE))
            for side, off in zip((rows, columns), rng.integers(-AROUND, AROUND + 1, 2))
        )
        box = np.s_[top : top + STORED_SIDE, left : left + STORED_SIDE]
        with new_file(folder / f"{number:04}.npz") as draft, draft.open("wb") as stream:
            np.savez(stream, color=case.source.color[box], truth=case.without.color[box], mask=case.mask[box])


def photo_crop(photos: Sequence[Photo], outlines: Sequence[BoolArray], side: int, rng: np.random.Generator) -> Crop:
    """A square of a photo that is at least so large."""
    while True:
        picture = photos[int(rng.integers(len(photos)))].load()
        if min(picture.shape[:2]) >= side:
            color = vary_light(square_crop(picture, side, rng), rng)
            return Crop(color, color, random_hole(outlines, side, rng))


def world_crop(files: Sequence[Path], side: int, rng: np.random.Generator) -> Crop:
    """A square of a world of `write_worlds`."""
    while True:
        with np.load(files[int(rng.integers(len(files)))]) as stored:
            planes = [stored["color"], stored["truth"], stored["mask"].astype(np.uint8)]
        if side < STORED_SIDE and rng.random() < WHOLE:
            ways = cv2.INTER_AREA, cv2.INTER_AREA, cv2.INTER_NEAREST
            planes = [cv2.resize(plane, (side, side), interpolation=how) for plane, how in zip(planes, ways)]
        top, left = rng.integers(0, len(planes[0]) - side + 1, 2)
        color, truth, mask = (plane[top : top + side, left : left + side] for plane in planes)
        hole = dilate_randomly(mask, WORLD_GROWTH, rng)
        if HOLE_SHARES[0] < hole.mean() < HOLE_SHARES[1]:
            gain = np.float32(rng.uniform(*BRIGHTER))
            return Crop(np.minimum(color * gain, 255), np.minimum(truth * gain, 255), hole)


def random_hole(outlines: Sequence[BoolArray], side: int, rng: np.random.Generator) -> BoolArray:
    """side x side: one outline or two, of random size and place."""
    while True:
        hole = np.zeros((side, side), np.uint8)
        for _ in range(2 if rng.random() < TWO else 1):
            put_outline(hole, outlines[int(rng.integers(len(outlines)))], rng)
        grown = dilate_randomly(hole, PHOTO_GROWTH, rng)
        if HOLE_SHARES[0] < grown.mean() < HOLE_SHARES[1]:
            return grown


def put_outline(hole: UInt8Array, outline: BoolArray, rng: np.random.Generator) -> None:
    """Draw an outline, mirrored or not, or the strip beside it, into a hole, at most a quarter of it beyond the border."""
    side = len(hole)
    longer = side * float(np.exp(rng.uniform(*np.log(LONGER_SIDES))))
    wh = [max(4, int(each * longer / max(outline.shape))) for each in outline.shape[::-1]]
    shape = cv2.resize(outline.astype(np.uint8), wh, interpolation=cv2.INTER_NEAREST)
    if rng.random() < 0.5:
        shape = np.ascontiguousarray(shape[:, ::-1])
    if rng.random() < STRIPS:
        step = int(rng.integers(4, wh[0] // 2 + 5))
        wider = np.pad(shape, ((0, 0), (step, step)))
        shape = np.roll(wider, step, 1) & (1 - wider)
    height, width = shape.shape
    row, column = (int(rng.integers(-each // 4, side - 3 * each // 4)) for each in (height, width))
    inside = np.s_[max(row, 0) : row + height, max(column, 0) : column + width]
    part = hole[inside]
    part |= shape[max(-row, 0) :, max(-column, 0) :][: part.shape[0], : part.shape[1]]


def dilate_randomly(hole: UInt8Array, sides: tuple[int, int], rng: np.random.Generator) -> BoolArray:
    """A hole dilated by a square."""
    side = int(rng.integers(*sides))
    return dilate_square(np.ascontiguousarray(hole), side)


def vary_light(picture: UInt8Array, rng: np.random.Generator) -> Float32Array:
    """A picture in other light."""
    return np.clip(picture * np.float32(rng.uniform(*BRIGHTER) * rng.uniform(*TINTED, 3)), 0, 255).astype(np.float32)
