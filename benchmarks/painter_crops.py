"""Photos and worlds in -> pictures with a hole, and what belongs there, for tuning the painter (`painter`), out.

Photos get holes of the outlines of other photos' salient objects, or a strip beside one, as a moved camera uncovers, or what a
turned camera does not see; the truth is the photo. Worlds get an object removed; the truth is the world without it. Views are of
photos and worlds from another place, as small as a painter sees them. Depth of worlds and views is painted, too, in grey.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from dlama.errors import DlamaError, MaskError
from dlama.geometry.holes import box_around, dilate_square, shrink_known
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.layered.depth.surfaces import continue_lawfully
from dlama.inpainters.layered.depth_first import find_occluders
from dlama.perception.masks.salient import saliency
from dlama.training.data.photos import read_photo, square_crop
from dlama.training.data.samples.world_views import WorldSet
from dlama.writing.atomic_write import new_file
from view_tasks import FillTask, photo_task, pipeline_tasks
from world_cases import world_case

WORLD_SIDE, STORED_SIDE, AROUND = 512, 384, 60
"""Pixels of a world's picture, and of the square of it that is kept; their middles are at most so far apart."""
VIEW_SIDE = 256
"""Pixels of a view."""
FIRST_WORLD, MANY = 50_000, 20_000
OF_PHOTOS, TURNED, GREY = 0.6, 0.3, 0.25
"""Shares of views that are of photos, of photos' holes that a turned camera leaves, of stored crops that show depth."""
VIEW_SHARES, FOV_DEG, TURN_DEG = (0.02, 0.6), (50, 80), (40, 12)
"""Hole of a view, in pictures; degrees of a turned camera's field of view, and by which it turns aside and up at most."""
FARTHEST = 0.05
"""Inverse depth, of the nearest one's, that is white in a grey picture of metres."""
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
    """S x S, what is painted."""
    counted: BoolArray
    """S x S, the part of the hole whose truth is known: not what is hidden from the painter only."""


def outlines_of(photos: Sequence[Path]) -> list[BoolArray]:
    """The largest piece of the most salient object of each photo that has a fitting one, in its box."""
    found = []
    for photo in photos:
        try:
            salient = saliency(read_photo(photo)) > 0.5
        except MaskError:
            continue
        _, pieces, stats, _ = cv2.connectedComponentsWithStats(salient.astype(np.uint8))
        if len(stats) < 2:
            continue
        object_ = pieces == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
        if OUTLINE_SHARES[0] < object_.mean() < OUTLINE_SHARES[1]:
            found.append(np.ascontiguousarray(object_[box_around(object_, 0)]))
    return found


def write_worlds(folder: Path, count: int, photos: Sequence[Path]) -> None:
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
        mask, scale = case.mask[box], inverse_depth(case.source.depth).max()
        planes = {"color": case.source.color[box], "truth": case.without.color[box], "hole": mask, "counted": mask}
        near = {"near": case.source.depth, "true_near": case.without.depth}
        planes |= {name: (inverse_depth(depth[box]) / scale).astype(np.float16) for name, depth in near.items()}
        write_planes(folder / f"{number:04}.npz", planes)


def write_views(folder: Path, count: int, photos: Sequence[Path], first: int = 0, step: int = 1) -> None:
    """Views of photos and of worlds as a painter sees them, VIEW_SIDE pixels wide. OutputError."""
    folder.mkdir(parents=True, exist_ok=True)
    sets = [WorldSet("train", WORLD_SIDE, tuple(photos)), WorldSet("train", WORLD_SIDE)]
    for number in range(first, count, step):
        rng = np.random.default_rng([number, 3])
        while True:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    tasks = draw_tasks(photos, sets[int(rng.integers(2))], rng)
            except DlamaError:  # a photo of which no depth is estimated
                continue
            if (
                tasks
                and VIEW_SHARES[0] < tasks[0].view.color_hole.mean() < VIEW_SHARES[1]
                and tasks[0].view.valid.any()
            ):
                write_planes(folder / f"{number:04}.npz", planes_of_view(tasks[0]))
                break


def draw_tasks(photos: Sequence[Path], worlds: WorldSet, rng: np.random.Generator) -> list[FillTask]:
    """A photo from another place and back, or a world from another place."""
    if rng.random() < OF_PHOTOS:
        return [photo_task(photos[int(rng.integers(len(photos)))], WORLD_SIDE, rng)]
    views = worlds.views((FIRST_WORLD + int(rng.integers(MANY))) * worlds.group_size)
    if not views.pairs:
        return []
    source, target = views.pairs[0]
    return pipeline_tasks(views.frame(source), views.cameras[target], (views.frame(target),))


def planes_of_view(task: FillTask) -> dict[str, np.ndarray]:
    """What a painter sees of a view, small, and the truth."""
    view, size = task.view, (VIEW_SIDE, VIEW_SIDE)
    surfaces, depth, _ = continue_lawfully(view, task.context, 0)
    hidden = view.color_hole | find_occluders(view, surfaces, depth, task.context.law)
    color, share = shrink_known(view.color, ~hidden, size)
    hole, scale = share < 0.5, inverse_depth(view.known_depth).max()
    near, true_near = (inverse_depth(each) / scale for each in (view.known_depth, task.truth.depth))
    _, hole_share = shrink_known(near, view.color_hole, size)
    return {
        "color": np.clip(np.round(color), 0, 255).astype(np.uint8),
        "truth": cv2.resize(task.truth.color, size, interpolation=cv2.INTER_AREA),
        "hole": hole,
        "counted": hole & (hole_share > 0),
        "near": shrink_known(near, ~hidden, size)[0][..., 0].astype(np.float16),
        "true_near": cv2.resize(np.minimum(true_near, 2), size, interpolation=cv2.INTER_AREA).astype(np.float16),
    }


def write_planes(path: Path, planes: dict[str, np.ndarray]) -> None:
    """A file of `stored_crop`. OutputError."""
    with new_file(path) as draft, draft.open("wb") as stream:
        np.savez(stream, **planes)


def photo_crop(photos: Sequence[Path], outlines: Sequence[BoolArray], side: int, rng: np.random.Generator) -> Crop:
    """A square of a photo that is at least so large."""
    while True:
        picture = read_photo(photos[int(rng.integers(len(photos)))])
        if min(picture.shape[:2]) >= side:
            turned = rng.random() < TURNED
            square = square_crop(picture, min(picture.shape[:2]) if turned else side, rng)
            color = vary_light(cv2.resize(square, (side, side), interpolation=cv2.INTER_AREA), rng)
            hole = unseen_when_turned(side, rng) if turned else random_hole(outlines, side, rng)
            return Crop(color, color, hole, hole)


def unseen_when_turned(side: int, rng: np.random.Generator) -> BoolArray:
    """side x side: what a camera that is turned does not see of the view of another one, at the same place."""
    columns, rows = np.meshgrid(*[np.linspace(-1, 1, side)] * 2)
    while True:
        slope = np.tan(np.radians(rng.uniform(*FOV_DEG) / 2))
        yaw, pitch = (np.radians(rng.uniform(-each, each)) for each in TURN_DEG)
        rays = np.stack([columns * slope, rows * slope, np.ones_like(rows)])
        turn = cv2.Rodrigues(np.array([pitch, 0, 0]))[0] @ cv2.Rodrigues(np.array([0, yaw, 0]))[0]
        x, y, z = np.tensordot(turn, rays, 1)
        hole = (z <= 0) | (np.maximum(np.abs(x), np.abs(y)) > slope * z)
        if VIEW_SHARES[0] < hole.mean() < VIEW_SHARES[1]:
            return hole


def stored_crop(files: Sequence[Path], side: int, rng: np.random.Generator) -> Crop:
    """A square of a world of `write_worlds` or of a view of `write_views`: its colours, or its depth as a grey picture."""
    while True:
        with np.load(files[int(rng.integers(len(files)))]) as stored:
            grey = rng.random() < GREY
            pictures = [grey_picture(stored[name], rng) for name in ("near", "true_near")] if grey else []
            pictures = pictures or [stored["color"], stored["truth"]]
            masks = [stored[name].astype(np.uint8) for name in ("hole", "counted")]
        of_world = len(masks[0]) == STORED_SIDE
        if side < len(masks[0]) and rng.random() < WHOLE:
            pictures = [cv2.resize(one, (side, side), interpolation=cv2.INTER_AREA) for one in pictures]
            masks = [cv2.resize(one, (side, side), interpolation=cv2.INTER_NEAREST) for one in masks]
        top, left = rng.integers(0, len(masks[0]) - side + 1, 2)
        box = np.s_[top : top + side, left : left + side]
        if of_world:
            masks = [dilate_randomly(masks[0], WORLD_GROWTH, rng)] * 2
        hole, counted = (one[box] > 0 for one in masks)
        if counted.any() and (not of_world or HOLE_SHARES[0] < counted.mean() < HOLE_SHARES[1]):
            gain = np.float32(1 if grey else rng.uniform(*BRIGHTER))
            return Crop(*(np.minimum(one[box] * gain, 255).astype(np.float32) for one in pictures), hole, counted)


def grey_picture(near: np.ndarray, rng: np.random.Generator) -> Float32Array:
    """S x S x 3: inverse depth (1 = the nearest) as grey levels: white near, or, as in the paper, white far."""
    near = near.astype(np.float32)
    if rng.random() < 0.5:
        grey = np.minimum(near, 1)
    else:
        grey = np.minimum(FARTHEST / np.maximum(near, FARTHEST), 1)
    return np.repeat(np.round(255 * grey)[..., None], 3, 2)


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
