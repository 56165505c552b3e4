"""Worlds and photos in; crops about corrective clicks, each with a wrong mask and the true one, out: what the network of
corrections learns from.

Some crops show an object in a box, which is the mask there, or a mask that depth cuts out, as it is carried from another frame.
Else a wrong mask is what the network of clicks finds, or the true one, with parts added and left out: other objects, discs, half
planes, regions of one colour. The click lies in one of its errors. In some crops it is on a second object, which is to be added.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.random import Generator

from click_crops import SHARES, Crop, share_in_square, views_of_world, world_to_click_in
from click_photos import Object, innermost_pixel, largest_region, photo_with_objects
from dlama.geometry.holes import (
    box_around,
    dilate_mask,
    disc,
    erode_mask,
    morphological_open,
    nearest_known,
    sides_of,
)
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.perception.masks.click_network import (
    LARGEST_WINDOW,
    PLANES,
    SMALLEST_WINDOW,
    click_planes,
    object_probability,
)
from dlama.perception.masks.corrections import mark_clicks
from dlama.perception.masks.prompt import Pixel
from dlama.perception.masks.salient import WindowSaliency
from world_cases import SENSORS, as_seen

SENSOR_SHARES = (0.2, 0.25, 0.2, 0.35)
FOUND, LEVELS, MOST_EDITS = 0.5, (0.25, 0.75), 2
"""Share of wrong masks that the network of clicks finds, from which probability, and most parts that are changed,"""
OBJECT_ADDED, REACHES, RESIZED = 0.4, (0.1, 0.8), 0.3
"""shares of another object among parts that are added and of masks a pixel or two too wide or narrow, and how far other parts
reach over the object's size."""
LEVELS_APART, LOG_RADII = (4, 22), (-1.6, 0.3)
"""Differences of a region of one colour, levels; logarithm of a disc's radius over the object's size."""
TWO_OBJECTS, SMALLEST, AMID, FURTHER = 0.2, 0.01, 0.65, 0.4
"""Shares of crops with a second object to add, of the least error that is clicked on (of the object's area), of clicks amid their
error, not anywhere in it, and of crops with a further click of each kind that the mask agrees with."""
MARGINS, BOX_MARGINS, PER_OBJECT, IN_PHOTO, PUT = (1.1, 1.5), (1.2, 1.6), 2, 4, 0.65
"""Half the side of a crop over the reach of what it shows; crops of an object, and of the one of a photo; share of photos with
objects put on them."""
BOX_SIDES, IN_BOX = (-0.03, 0.2), (0.35, 0.25)
"""By which share of its length each side of a box is moved outwards; shares of boxes with a click and with a negative one."""
SAME_DEPTH, AROUND_PX = 0.05, (2, 6)
"""Largest relative difference of depth of a mask that depth cuts out, and how far round the object it may reach."""


class NothingSalient(WindowSaliency):
    """Saliency of a picture in which nothing is salient; no network runs."""

    def level(self, window: tuple[slice, slice]) -> None:
        """Nothing is salient in any window."""


def innermost(where: BoolArray) -> Pixel:
    """(row, column) of the innermost pixel."""
    column, row = innermost_pixel(where)
    return row, column


def any_pixel(where: BoolArray, rng: Generator) -> Pixel:
    """(row, column) of a pixel of `where` (H x W, not empty)."""
    row, column = rng.choice(np.argwhere(where))
    return int(row), int(column)


def region_of_color(color: UInt8Array, pixel: Pixel, rng: Generator) -> BoolArray:
    """H x W, the connected region about (row, column) of about its colour, or of about its neighbours' from pixel to pixel."""
    fixed, levels = bool(rng.random() < 0.5), float(rng.uniform(*LEVELS_APART))
    flags = 4 | cv2.FLOODFILL_MASK_ONLY | (1 << 8) | (cv2.FLOODFILL_FIXED_RANGE if fixed else 0)
    apart = (levels if fixed else levels / 5,) * 3
    blurred = np.ascontiguousarray(cv2.GaussianBlur(color, (0, 0), 1.5))
    out = np.zeros((color.shape[0] + 2, color.shape[1] + 2), np.uint8)
    cv2.floodFill(blurred, out, pixel[::-1], 0, apart, apart, flags)
    return np.asarray(out[1:-1, 1:-1] > 0)


def part_about(frame: RGBD, pixel: Pixel, size: float, rng: Generator) -> BoolArray:
    """H x W, a disc, a half plane or a region of one colour about (row, column). size: of the object, px."""
    v, u = np.ogrid[: frame.depth.shape[0], : frame.depth.shape[1]]
    kind, radius = int(rng.integers(4)), size * float(np.exp(rng.uniform(*LOG_RADII)))
    near = np.asarray(np.hypot(v - pixel[0], u - pixel[1]) < radius)
    if kind == 0:
        return near
    if kind == 1:
        turn = rng.uniform(0, 2 * np.pi)
        return np.asarray((u - pixel[1]) * np.cos(turn) + (v - pixel[0]) * np.sin(turn) > 0)
    region = region_of_color(frame.color, pixel, rng)
    return region & near if kind == 2 else region


def wrong_mask(frame: RGBD, true: BoolArray, others: Sequence[BoolArray], rng: Generator) -> BoolArray:
    """H x W, a mask of an object (true) as one click may find it, or the true one, with parts added and left out."""
    found, mask, size = bool(rng.random() < FOUND), true, float(np.sqrt(true.sum()))
    if found:
        seen = NothingSalient(frame.color) if frame.estimate is not None else None
        mask = object_probability(frame, any_pixel(true, rng), seen)[0] > rng.uniform(*LEVELS)
    rim = dilate_mask(true, 3) & true, dilate_mask(true, max(2, int(size / 8))) & ~true
    for _ in range(int(rng.integers(0 if found else 1, MOST_EDITS + 1))):
        if rng.random() < 0.5:
            mask = mask & ~part_about(frame, any_pixel(rim[0], rng), size, rng)
        elif others and rng.random() < OBJECT_ADDED:
            mask = mask | others[int(rng.integers(len(others)))]
        elif rim[1].any():
            near = dilate_mask(true, int(size * rng.uniform(*REACHES)) + 1)
            mask = mask | (part_about(frame, any_pixel(rim[1], rng), size, rng) & near)
    if rng.random() < RESIZED:
        mask = (dilate_mask if rng.random() < 0.5 else erode_mask)(mask, int(rng.integers(1, 3)))
    return np.asarray(mask)


def corrections_of(
    frame: RGBD, true: BoolArray, on_it: BoolArray, others: Sequence[BoolArray], rng: Generator
) -> Iterator[Crop]:
    """A crop about a click in an error of a wrong mask of an object (true; on_it: what stands on it, which does not count); none
    where the mask is right. others: masks of other objects, which may be added to it, or clicked on, too."""
    others = [other for other in others if not (other & true).any()]
    mask, clicks = wrong_mask(frame, true, others, rng), {True: [innermost(true)], False: []}
    if others and rng.random() < TWO_OBJECTS:
        error, belongs = others[int(rng.integers(len(others)))], True
        true, mask = true | error, mask & ~error
    else:
        errors = {True: true & ~mask & ~on_it, False: mask & ~true & ~on_it}
        largest = {kind: largest_region(error) for kind, error in errors.items() if error.any()}
        sizes = {kind: int(part.sum()) for kind, part in largest.items() if part.sum() > SMALLEST * true.sum()}
        if not sizes:
            return
        shares = np.array(list(sizes.values()), np.float64)
        belongs = list(sizes)[int(rng.choice(len(sizes), p=shares / shares.sum()))]
        error = largest[belongs]
    pixel = innermost(error)
    if rng.random() > AMID:
        inner = morphological_open(error, disc(2))
        pixel = any_pixel(inner if inner.any() else error, rng)
    clicks[belongs].append(pixel)
    next_to = dilate_mask(true, int(np.sqrt(true.sum()) / 2)) & ~true & ~mask & ~on_it
    for kind, where in ((True, true & mask), (False, next_to)):
        if where.any() and rng.random() < FURTHER:
            clicks[kind].append(any_pixel(where, rng))
    yield crop_about(frame, pixel, side_of_crop(pixel, mask, error, rng), mask, clicks, true, on_it)


def box_crop(frame: RGBD, true: BoolArray, on_it: BoolArray, rng: Generator) -> Crop:
    """A crop round a box that holds an object, the box as the mask; some with clicks."""
    tight = box_around(true, 0)
    box = []
    for side, most in zip(tight, true.shape):
        apart = rng.uniform(*BOX_SIDES, 2) * (side.stop - side.start)
        start, stop = max(0, round(side.start - apart[0])), min(most, round(side.stop + apart[1]))
        box.append(slice(start, max(stop, start + 2)))
    mask = np.zeros_like(true)
    mask[box[0], box[1]] = True
    clicks: dict[bool, list[Pixel]] = {True: [], False: []}
    for (kind, where), share in zip(((True, true & mask), (False, mask & ~true & ~on_it)), IN_BOX):
        if where.any() and rng.random() < share:
            clicks[kind].append(any_pixel(where, rng))
    row, column = ((side.start + side.stop) // 2 for side in box)
    radius = int(rng.uniform(*BOX_MARGINS) * max(sides_of((box[0], box[1]))) / 2) + 2
    planes, *rest = crop_about(frame, (row, column), radius, mask, clicks, true, on_it)
    planes[PLANES.index("click")] = 0
    return planes, *rest


def carried_crop(frame: RGBD, true: BoolArray, on_it: BoolArray, rng: Generator) -> Crop | None:
    """A crop about the middle of a mask that depth cuts out, as masks carried from other frames are; None where it has none."""
    core = erode_mask(true, 2) & frame.valid
    if not core.any():
        return None
    there = frame.depth.ravel()[nearest_known(core)[1]]
    mask = dilate_mask(true, int(rng.integers(*AROUND_PX))) & (np.abs(frame.depth - there) < SAME_DEPTH * there)
    if rng.random() < 0.5:
        mask = mask | (frame.missing & dilate_mask(true, int(rng.integers(0, 4))))
    if rng.random() < 0.4:
        mask = mask & ~part_about(frame, any_pixel(true, rng), float(np.sqrt(true.sum())), rng)
    if not mask.any():
        return None
    pixel = innermost(mask)
    if not true[pixel]:
        return None
    radius = side_of_crop(pixel, mask, true, rng)
    return crop_about(frame, pixel, radius, mask, {True: [pixel], False: []}, true, on_it)


def side_of_crop(pixel: Pixel, mask: BoolArray, error: BoolArray, rng: Generator) -> int:
    """Half the side in px of a crop that shows what lies between the error and all of the mask."""
    error_px, mask_px = (float(np.abs(np.argwhere(where) - pixel).max()) for where in (error, mask | error))
    margin, least = float(rng.uniform(*MARGINS)), SMALLEST_WINDOW / 2
    low, high = max(1.2 * error_px * margin, least), max(mask_px * margin, least)
    drawn = float(np.exp(rng.uniform(np.log(min(low, high)), np.log(high))))
    return int(np.clip(drawn, least, LARGEST_WINDOW * max(mask.shape) / 2))


def crop_about(
    frame: RGBD,
    pixel: Pixel,
    radius: int,
    mask: BoolArray,
    clicks: Mapping[bool, list[Pixel]],
    true: BoolArray,
    on_it: BoolArray,
) -> Crop:
    """The square of 2 radius + 1 px about (row, column), as `dlama.perception.masks.corrections` shows it to the network."""
    maps = mask, *(mark_clicks(mask.shape, clicks[kind], radius) for kind in (True, False))
    planes = click_planes(frame, pixel, radius, [])
    seen = np.stack([share_in_square(each, pixel, radius) for each in maps])
    target, other = (share_in_square(where, pixel, radius) for where in (true, on_it))
    return planes, np.uint8(np.round(255 * seen)), np.uint8(np.round(255 * target)), np.uint8(other < 0.5)


def crops_of_world(number: int, photos: Sequence[Path]) -> Iterator[Crop]:
    """The crops of a world's objects."""
    rng = np.random.default_rng([number, 87])
    made, _ = world_to_click_in(number, photos, rng)
    for scene, numbers in views_of_world(made, rng):
        masks = {each: scene.mask(each) for each in numbers}
        for sensor in rng.choice(SENSORS, 2, replace=False, p=SENSOR_SHARES) if numbers else ():
            frame = as_seen(scene.frame, sensor, rng)
            for each in numbers:
                others = [mask for other, mask in masks.items() if other != each]
                base = scene.stands_on.get(each)
                if base is not None and scene.mask(base).any():
                    others.append(scene.mask(base))
                for _ in range(PER_OBJECT):
                    yield from corrections_of(frame, masks[each], scene.on_it(each), others, rng)
                yield box_crop(frame, masks[each], scene.on_it(each), rng)
                carried = None if sensor == "estimated" else carried_crop(frame, masks[each], scene.on_it(each), rng)
                if carried:
                    yield carried


def crops_of_photo(
    number: int, objects: Sequence[Object], cut_outs: Sequence[Object], grounds: Sequence[Path]
) -> Iterator[Crop]:
    """As `crops_of_world`: a photo with a clear object, or cut-outs put on a photo."""
    rng = np.random.default_rng([number, 88])
    put = bool(rng.random() < PUT)
    frame, masks = photo_with_objects(cut_outs if put else objects, grounds, rng, put)
    if frame is None:
        return
    for n, mask in enumerate(masks):
        if mask.mean() > SHARES[0]:
            others = [each for k, each in enumerate(masks) if k != n and each.mean() > SHARES[0]]
            for _ in range(PER_OBJECT if put else IN_PHOTO):
                yield from corrections_of(frame, mask, np.zeros_like(mask), others, rng)
            for _ in range(1 if put else 2):
                yield box_crop(frame, mask, np.zeros_like(mask), rng)
