"""Worlds and photos in; crops about clicks, and what belongs to the object there, out: what the network of clicks learns from.

A crop is a square about a click, as `click_network.click_planes` cuts it: one of most of the picture, one about the object.
Half of the worlds have objects on islands, plinths and tables, half are crowded (`click_clutter`); two sensors of
`world_cases.SENSORS` see each picture. Photos are textures of six worlds in ten, and pictures themselves (`click_photos`): worlds
alone teach a network that a patch of colour on a car or a frog is an object. Small objects lie on the objects of other pictures:
the salient object of a square need not be the one clicked on. At clicks on the background nothing belongs to an object.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.random import Generator

from click_photos import Object, estimated, innermost_pixel, largest_region, photo_with_objects, put_object
from click_worlds import ClickScene, ClickWorld, objects_in_sight
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.masks.click_network import (
    FIRST_WINDOW,
    PLANES,
    SALIENT,
    SIDE,
    click_planes,
    first_window,
    salient_about,
)
from dlama.perception.masks.prompt import Pixel
from dlama.perception.masks.salient import WindowSaliency
from dlama.training.data.photos import square_crop
from world_cases import SENSORS, as_seen

FIRST_WORLD, PICTURE_PX, VIEWS, MOST_OBJECTS = 1_007_000_000, 448, 2, 6
STANDS, CROWDED, NEAR = 0.5, 0.5, 0.35
"""Share of worlds with islands and plinths, of crowded ones, and of views from near."""
SENSOR_SHARES = (0.12, 0.28, 0.2, 0.4)
SHARES, FARTHEST_M, ONE_PIECE = (0.002, 0.25), 9.0, 0.7
"""Of objects: share of the picture, median depth, least share that hangs together."""
TEXTURED, TEXTURES, TEXTURE_PX = 0.6, 8, 256
CUT_OFF, ANYWHERE = 0.3, 0.4
"""Share of views with objects that the rim cuts, and of clicks anywhere on an object, not amid it."""
FAR_SCALES, NEAR_SCALES, LEAST_REACH = (0.8, 1.2), (1.15, 2.2), 6
"""Sides of the two squares: over FIRST_WINDOW of the picture, and over twice the object's reach from the click (px)."""
SMALL, SMALL_SIDES = 0.5, (0.12, 0.6)
"""Share of pictures without textures in which a small object lies on an object, and its longer side over the root of that one's
area."""
BACKGROUND, BESIDE_PX, EMPTY_SIDES = 2, 6, (0.15, 0.6)
"""Clicks on the background of a picture, their least distance from objects, and sides of the near square
over the picture's."""
PER_FILE = 10
Crop = tuple[Float32Array, np.ndarray, np.ndarray, np.ndarray]
"""Planes but those of saliency; those (uint8); the object's share of each pixel (uint8), and which pixels count (what stands on
the object does not)."""


def world_to_click_in(number: int, photos: Sequence[Path], rng: Generator) -> tuple[ClickWorld, bool]:
    """A world, and whether photos are its textures."""
    textures = []
    if photos and rng.random() < TEXTURED:
        for file in rng.choice(np.array(photos, object), TEXTURES):
            picture = cv2.imread(str(file))[..., ::-1]
            textures.append(square_crop(np.ascontiguousarray(picture), TEXTURE_PX, rng))
    stands, crowded = (bool(rng.random() < share) for share in (STANDS, CROWDED))
    return ClickWorld(FIRST_WORLD + number, tuple(textures), stands=stands, crowded=crowded), bool(textures)


def views_of_world(made: ClickWorld, rng: Generator) -> Iterator[tuple[ClickScene, list[int]]]:
    """VIEWS of a world, and the numbers of the objects to click on there."""
    for _ in range(VIEWS):
        scene = made.scene(made.world.camera(float(rng.uniform(-60, 60)), PICTURE_PX, float(rng.uniform(55, 95))))
        scene = made.near_scene(scene, rng) if rng.random() < NEAR else scene
        seen = rng.permutation(objects_in_sight(scene, *SHARES, cut_off=rng.random() < CUT_OFF)).tolist()
        near = [each for each in seen if np.median(scene.frame.depth[scene.mask(each)]) < FARTHEST_M]
        yield scene, near[:MOST_OBJECTS]


def crops_of_world(number: int, photos: Sequence[Path], objects: Sequence[Object]) -> Iterator[Crop]:
    """The crops of a world's objects."""
    rng = np.random.default_rng([number, 77])
    made, textured = world_to_click_in(number, photos, rng)
    for scene, numbers in views_of_world(made, rng):
        for sensor in rng.choice(SENSORS, 2, replace=False, p=SENSOR_SHARES) if numbers else ():
            small = np.zeros(scene.group.shape, np.bool_)
            frame = scene.frame
            if sensor == "estimated" and not textured and rng.random() < SMALL:
                frame, small = with_small_object(frame, scene.mask(int(rng.choice(numbers))), objects, rng)
            frame = as_seen(frame, sensor, rng)
            if small.any():
                yield from crops_of_click(frame, small, np.zeros_like(small), rng)
            for each in numbers:
                yield from crops_of_click(frame, scene.mask(each) & ~small, scene.on_it(each) | small, rng)
            yield from crops_of_background(frame, scene.background & ~small, rng)


def crops_of_photo(
    number: int, objects: Sequence[Object], cut_outs: Sequence[Object], grounds: Sequence[Path]
) -> Iterator[Crop]:
    """As `crops_of_world`: in turn a photo with a clear object, cut-outs put on a photo, and a small object on an object."""
    rng = np.random.default_rng([number, 78])
    kind = number % 3
    put = kind == 1 or (kind == 2 and rng.random() < 0.5)
    frame, masks = photo_with_objects(cut_outs if kind == 1 else objects, grounds, rng, put)
    if frame is None:
        return
    small = np.zeros(frame.depth.shape, np.bool_)
    if kind == 2:
        frame, small = with_small_object(frame, max(masks, key=np.sum), objects, rng)
        frame = estimated(frame.color)
        if frame is None:
            return
        yield from crops_of_click(frame, small, np.zeros_like(small), rng)
    for mask in masks:
        if mask.mean() > SHARES[0]:
            yield from crops_of_click(frame, mask & ~small, small, rng)
    if kind == 0:
        yield from crops_of_background(frame, ~masks[0], rng)


def with_small_object(
    frame: RGBD, mask: BoolArray, objects: Sequence[Object], rng: Generator
) -> tuple[RGBD, BoolArray]:
    """The picture with an object on or partly on another one (H x W mask), and where it is seen; depth stays."""
    color = frame.color.astype(np.float32)
    size = float(np.exp(rng.uniform(*np.log(SMALL_SIDES)))) * float(np.sqrt(mask.sum()))
    row, column = rng.choice(np.argwhere(mask))
    small = put_object(color, objects[int(rng.integers(len(objects)))], size, (int(row), int(column)), rng)
    return dataclasses.replace(frame, color=np.round(color).astype(np.uint8)), small


def crops_of_background(frame: RGBD, background: BoolArray, rng: Generator) -> Iterator[Crop]:
    """Crops of clicks on the background (H x W), where no object is found."""
    inner = np.argwhere(~dilate_mask(~background, BESIDE_PX))
    empty = np.zeros_like(background)
    for row, column in rng.permutation(inner)[:BACKGROUND].tolist():
        sides = rng.uniform(*FAR_SCALES) * FIRST_WINDOW, rng.uniform(*EMPTY_SIDES)
        yield from crops_about(frame, (row, column), [max(empty.shape) * side for side in sides], empty, empty)


def crops_of_click(frame: RGBD, mask: BoolArray, on_it: BoolArray, rng: Generator) -> Iterator[Crop]:
    """Two crops of a click on an object (H x W mask; `on_it`: what stands on it); none of an object in pieces."""
    if not mask.any() or (largest_region(dilate_mask(mask, 2)) & mask).sum() < ONE_PIECE * mask.sum():
        return
    column, row = innermost_pixel(mask)
    if rng.random() < ANYWHERE:
        row, column = (int(at) for at in rng.choice(np.argwhere(mask)))
    reach = max(float(np.abs(np.argwhere(mask) - (row, column)).max()), LEAST_REACH)
    sides = FIRST_WINDOW * max(mask.shape) * rng.uniform(*FAR_SCALES), 2 * reach * rng.uniform(*NEAR_SCALES)
    yield from crops_about(frame, (row, column), sides, mask, on_it)


def crops_about(frame: RGBD, pixel: Pixel, sides: Sequence[float], mask: BoolArray, on_it: BoolArray) -> Iterator[Crop]:
    """A crop for each side (px) of a square about (row, column)."""
    seen = WindowSaliency(frame.color) if frame.estimate is not None else None
    for radius in (int(side / 2) for side in sides):
        asked = first_window(mask.shape), 2 * radius + 1
        planes = click_planes(
            frame, pixel, radius, [salient_about(seen, pixel, each) for each in asked] if seen else []
        )
        salient = planes[len(PLANES) :] if seen else np.zeros((len(SALIENT), SIDE, SIDE))
        target, other = (share_in_square(where, pixel, radius) for where in (mask, on_it))
        parts = (np.uint8(np.round(255 * each)) for each in (salient, target))
        yield planes[: len(PLANES)], *parts, np.uint8(other < 0.5)


def share_in_square(where: BoolArray, pixel: Pixel, radius: int) -> Float32Array:
    """SIDE x SIDE share of `where` in the square of 2 radius + 1 px about (row, column)."""
    padded = np.pad(where.astype(np.float32), radius)
    part = padded[pixel[0] : pixel[0] + 2 * radius + 1, pixel[1] : pixel[1] + 2 * radius + 1]
    how = cv2.INTER_AREA if len(part) > SIDE else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(part, (SIDE, SIDE), interpolation=how), np.float32)


def write_crops(folder: Path, kind: str, numbers: range, crops: Callable[[int], Iterator[Crop]]) -> None:
    """Three files for PER_FILE worlds or pictures; those that are there stay. Not compressed: training reads single crops."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in (numbers[first : first + PER_FILE] for first in range(0, len(numbers), PER_FILE)):
        file = folder / f"{kind}-{part[0]:05d}.truth.npy"
        if not file.exists():
            planes, salient, *truth = zip(*(crop for number in part for crop in crops(number)))
            half = np.stack([each.astype(np.float16) for each in planes])
            np.save(file.with_name(f"{kind}-{part[0]:05d}.planes.npy"), half)
            np.save(file.with_name(f"{kind}-{part[0]:05d}.salient.npy"), np.stack(salient))
            np.save(file, np.stack([np.stack(each) for each in truth], 1))
            print(f"{file.name}: {len(planes)} crops", flush=True)
