"""Photos in; pictures with estimated depth, and the masks of the objects in them, out: what a click in a photo means.

A photo has a clear object where the network of `salient` finds the same in it, in its mirror image and in its middle. Half of
the pictures are such photos. In the others such objects are cut out and put onto other photos, where one hides another: there
the truth does not depend on where that network thinks an object ends.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.random import Generator

from dlama.errors import InputError, MaskError
from dlama.geometry.holes import iou, region_at
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.masks.salient import saliency
from dlama.perception.monocular import estimate_depth
from dlama.training.data.photos import read_photo, square_crop

LEARNT, TUNE, VALIDATE = (1, 2, 3, 4, 6, 7, 8, 9), (0,), (5,)
"""Groups of photos (`group_of`): those that the network of clicks learns from, and those of the splits that measure it."""
VIDEOS, SINGLE = ("camvid",), ("imagenet",)
"""Folders of frames, and of photos that mostly show one object."""
Object = tuple[UInt8Array, BoolArray]
"""A photo (H x W x 3) and the mask of its object (H x W)."""
AREA, UNSURE = (0.02, 0.6), (0.2, 0.8)
"""Share of the photo of a clear object; saliency of unsure pixels."""
MIDDLE = 0.88
"""Side of the middle over the photo's."""
MOST_OBJECTS, LENGTHS, TONES, SIDES = 4, (0.12, 0.6), (0.75, 1.25), (288, 448)
"""Of objects on another photo: how many, longer side over the photo's, brightness; sides of that photo."""


class Limits(NamedTuple):
    """How clear an object is."""

    one_piece: float
    """Least share that hangs together."""
    same: float
    """Least intersection over union with what is found in the mirror image and in the middle."""
    unsure: float
    """Most unsure pixels over the object's."""


CLEAR, CUT_OUT = Limits(0.9, 0.85, 0.12), Limits(0.8, 0.7, 0.25)
"""Of an object in its photo, and of one that is put on another picture: there its mask is true, even if it is a part."""


def group_of(file: Path) -> int:
    """0 to 9 for a photo by its name, frames of a video (all before the first _, where a folder holds several) together."""
    name = file.stem if file.parent.name not in VIDEOS else file.stem.split("_")[0]
    return int(hashlib.sha256(name.encode()).hexdigest(), 16) % 10


def innermost_pixel(where: BoolArray) -> tuple[int, int]:
    """x, y of the pixel farthest from where `where` (H x W, not empty) ends; the picture's rim ends it too."""
    distance = cv2.distanceTransform(np.pad(where.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    row, column = np.unravel_index(int(distance.argmax()), distance.shape)
    return int(column), int(row)


def largest_region(where: BoolArray) -> BoolArray:
    """The largest 8-connected region of `where` (H x W)."""
    return region_at(where, np.s_[:, :])


def photos_of(folder: Path, groups: Sequence[int]) -> list[Path]:
    """The photos in the folders of a folder that are in these groups, by path."""
    return [file for file in sorted(folder.glob("*/*.jpg")) if group_of(file) in groups]


def clear_object(color: UInt8Array, limits: Limits = CLEAR) -> BoolArray | None:
    """H x W mask of the salient object of a photo; None where it is not clear."""
    height, width = color.shape[:2]
    top, left = (round(n * (1 - MIDDLE) / 2) for n in (height, width))
    middle = np.s_[top : height - top, left : width - left]
    try:
        level = saliency(color)
        mask = level > 0.5
        unsure = ((level > UNSURE[0]) & (level < UNSURE[1])).sum()
        if not AREA[0] < mask.mean() < AREA[1] or unsure > limits.unsure * mask.sum():
            return None
        for part, turn in ((np.s_[:], -1), (middle, 1)):
            seen = saliency(np.ascontiguousarray(color[part][:, ::turn]))[:, ::turn] > 0.5
            if iou(mask[part], seen) <= limits.same:
                return None
    except MaskError:
        return None
    region = largest_region(mask)
    return region if region.sum() > limits.one_piece * mask.sum() else None


def clear_objects(files: Sequence[Path], limits: Limits = CLEAR) -> list[Object]:
    """The photos of SINGLE that have a clear object."""
    photos = (read_photo(file) for file in files if file.parent.name in SINGLE)
    return [(photo, mask) for photo in photos if (mask := clear_object(photo, limits)) is not None]


def put_objects(ground: UInt8Array, objects: Sequence[Object], rng: Generator) -> tuple[UInt8Array, list[BoolArray]]:
    """The ground with objects on it, later ones before earlier ones, and what is seen of each (H x W)."""
    picture, number = ground.astype(np.float32), np.zeros(ground.shape[:2], np.uint8)
    for n, each in enumerate(objects, 1):
        size = float(np.exp(rng.uniform(*np.log(LENGTHS)))) * min(ground.shape[:2])
        number[put_object(picture, each, size, None, rng)] = n
    return np.round(picture).astype(np.uint8), [number == n for n in range(1, len(objects) + 1)]


def put_object(
    picture: Float32Array, one: Object, longer: float, middle: tuple[int, int] | None, rng: Generator
) -> BoolArray:
    """Put an object, its longer side in px, onto a picture (changed) about (row, column), or anywhere; H x W where it is."""
    color, mask = one
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    height, width = (part.stop - part.start for part in box)
    by = longer / max(height, width)
    size = max(2, round(by * width)), max(2, round(by * height))
    part = cv2.resize(color[box], size, interpolation=cv2.INTER_AREA) * rng.uniform(*TONES)
    alpha = cv2.resize(mask[box].astype(np.float32), size, interpolation=cv2.INTER_AREA)
    room = [n - s for n, s in zip(picture.shape, size[::-1])]
    if middle is None:
        top, left = (int(rng.integers(0, n + 1)) for n in room)
    else:
        top, left = (int(np.clip(at - s // 2, 0, n)) for at, s, n in zip(middle, size[::-1], room))
    there = slice(top, top + size[1]), slice(left, left + size[0])
    picture[there] += alpha[..., None] * (np.minimum(part, 255) - picture[there])
    seen = np.zeros(picture.shape[:2], np.bool_)
    seen[there] = alpha > 0.5
    return seen


def estimated(color: UInt8Array) -> RGBD | None:
    """The picture with estimated depth; None where it shows too little for one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return estimate_depth(color).rgbd
        except InputError:
            return None


def photo_with_objects(
    objects: Sequence[Object], grounds: Sequence[Path], rng: Generator, put: bool
) -> tuple[RGBD | None, list[BoolArray]]:
    """A picture and what is seen of its objects (H x W each): a photo with a clear object, or objects put onto a ground."""
    if not put:
        color, mask = objects[int(rng.integers(len(objects)))]
        return estimated(color), [mask]
    ground = square_crop(read_photo(grounds[int(rng.integers(len(grounds)))]), int(rng.integers(*SIDES)), rng)
    chosen = [objects[int(n)] for n in rng.integers(0, len(objects), rng.integers(1, MOST_OBJECTS + 1))]
    color, masks = put_objects(ground, chosen, rng)
    return estimated(color), masks
