"""Worlds and photos in -> crops of completed views, each with all guesses and the truth, in a folder, out.

Views are those of run time: `complete` itself renders them, and a filler that only looks records what it is asked to fill.
Guesses cost most of the time, so they are made once (`python benchmarks/choice.py crops`) and trained on many times.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import cv2
import numpy as np

from dlama.completion.pipeline import complete
from dlama.errors import DlamaError
from dlama.files.atomic_write import new_file
from dlama.geometry.camera import Camera
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.trajectories import dolly, median_pivot, orbit
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.choice.guesses import GUESSES, make_guesses
from dlama.inpainters.choice.planes import context_planes, depth_scale, nearness
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill
from dlama.inpainters.layered.filler import layered
from dlama.perception.monocular import estimate_depth
from dlama.training.data.augment import add_depth_faults
from dlama.training.data.photos import Photo, square_crop
from dlama.training.data.samples.guesses import INDEX, LEVELS, SIDE, GuessCrop
from dlama.training.data.samples.views import hole_size_fits
from dlama.training.data.samples.world_views import WorldSet, WorldViews
from dlama.training.data.samples.worlds import frame_without, removable_object
from sensors import add_photo_noise, stereo_matcher, structured_light

SIZES = (320, 416, 512)
"""Heights and widths of the views that crops are cut from."""
HOLE_SHARE = (0.02, 0.9)
"""Of a crop."""
PHOTO_SHARE, REMOVAL_SHARE = 0.35, 0.3
"""Of the examples: photos with estimated depth; of the rest, removals."""
CROPS_PER_VIEW, EXAMPLES_PER_WORLD = 2, 4


@dataclass(frozen=True, eq=False)
class FillTask:
    """What a filler was asked to fill, and the truth."""

    view: View
    context: FillContext
    truth: RGBD
    depth_true: bool = True
    """Whether the truth's depth is one (that of photos is only estimated)."""


def write_crops(folder: Path, count: int, photos: Sequence[Photo], seed: int, split: str = "train") -> int:
    """Add crops (2 MB each) to `folder`/`split` until it has `count`. Returns how many were made. OutputError."""
    folder = folder / split
    folder.mkdir(parents=True, exist_ok=True)
    (folder / INDEX).write_text("\n".join(GUESSES) + "\n", "utf-8")
    made, number = 0, len(list(folder.glob("*.npz")))
    for crop in crops(photos, seed + 7919 * number, split):
        if number >= count:
            break
        with new_file(folder / f"{number:05}.npz") as draft, draft.open("wb") as stream:
            np.savez(stream, **{one.name: getattr(crop, one.name) for one in fields(crop)})
        number, made = number + 1, made + 1
    return made


def crops(photos: Sequence[Photo], seed: int, split: str) -> Iterator[GuessCrop]:
    """Crops without end, worlds and photos in turn."""
    rng = np.random.default_rng([seed, 11])
    while True:
        size = int(rng.choice(SIZES))
        worlds = WorldSet(split, size, tuple(photos))
        views = worlds.views_of_world(int(rng.integers(100_000)))
        for _ in range(EXAMPLES_PER_WORLD):
            for asked in random_tasks(views, size, photos, rng):
                yield from crops_of(asked, rng)


def random_tasks(views: WorldViews, size: int, photos: Sequence[Photo], rng: np.random.Generator) -> list[FillTask]:
    """What the filler is asked for one example: of a photo, or of a world with an object removed or another camera."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if photos and rng.random() < PHOTO_SHARE:
                return photo_tasks(photos[int(rng.integers(len(photos)))], size, rng)
            return world_tasks(views, rng)
    except DlamaError:  # a picture of nothing, a mask that covers all
        return []


def world_tasks(views: WorldViews, rng: np.random.Generator) -> list[FillTask]:
    """A frame of a world as some sensor saw it, completed."""
    number, target = views.pairs[int(rng.integers(len(views.pairs)))] if views.pairs else (0, 0)
    frame = views.frame(number)
    removed = removable_object(views, number, rng) if rng.random() < REMOVAL_SHARE else None
    source = simulate_sensor(frame, rng)
    if removed is None:
        return pipeline_tasks(source, views.cameras[target], None, (frame, views.frame(target)))
    mask = views.raycast(number).group == removed
    around = cv2.dilate(mask.astype(np.uint8), np.ones((13, 13), np.uint8)) > 0
    truth = frame_without(views, number, removed, around)
    return pipeline_tasks(source, frame.camera, mask, (truth,))


def simulate_sensor(frame: RGBD, rng: np.random.Generator) -> RGBD:
    """The frame as it is, with light faults, or as a structured-light camera or a matcher saw it."""
    if rng.random() < 0.5:
        frame = dataclasses.replace(frame, color=add_photo_noise(frame.color, rng))
    how = rng.random()
    if how < 0.5:
        return add_depth_faults(frame, rng)
    return structured_light(frame, rng) if how < 0.75 else stereo_matcher(frame, rng)


def pipeline_tasks(source: RGBD, camera: Camera, mask: BoolArray | None, truths: Sequence[RGBD]) -> list[FillTask]:
    """The views that `complete` has filled, those whose truth is given."""
    found: list[FillTask] = []

    def look(view: View, context: FillContext, seed: int) -> Fill:
        found.extend(FillTask(view, context, truth) for truth in truths if truth.camera.same_view_as(view.camera))
        if view.camera.same_view_as(source.camera):
            return layered(view, context, seed)  # the camera may move from here
        return Fill(view.color, np.ones(view.hole.shape, np.float32))

    complete(source, [camera], mask=mask, filler=look)
    return found


def photo_tasks(photo: Photo, size: int, rng: np.random.Generator) -> list[FillTask]:
    """A photo as seen from another camera and back: holes are what that camera does not see, by estimated depth."""
    stored = photo.load()
    size = max(SIDE, min(size, *stored.shape[:2]))  # not enlarged: blurred truth would teach blur
    picture = square_crop(stored, size, rng)
    frame = estimate_depth(picture, Camera.from_fov(size, size, float(rng.uniform(50, 85)))).rgbd
    pivot = median_pivot(frame.depth) * float(rng.uniform(0.7, 1.5))
    yaw, pitch = float(rng.uniform(4, 45) * rng.choice((-1, 1))), float(rng.uniform(-5, 8))
    away = dolly(orbit(frame.camera, yaw, pitch, pivot), float(rng.uniform(-0.2, 0.3)) * pivot)
    seen = render(frame, away)
    back = render(seen, frame.camera)
    color = np.where(back.hole[..., None], np.uint8(0), picture)
    view = dataclasses.replace(back, color=color)
    return [FillTask(view, FillContext(Law(())), RGBD(picture, frame.depth, frame.camera), depth_true=False)]


def crops_of(asked: FillTask, rng: np.random.Generator) -> Iterator[GuessCrop]:
    """Up to CROPS_PER_VIEW squares of a view, none where its hole is of no fitting size."""
    view = asked.view
    if not (hole_size_fits(view.hole) and view.valid.any()):
        return
    places = [place for place in (_place(view.hole, rng) for _ in range(CROPS_PER_VIEW)) if place is not None]
    if view.hole.mean() < 0.1:
        places = places[:1]
    if places:
        whole = planes_of(asked)
        for top, left in places:
            yield _cut_square(whole, top, left)


def _place(hole: BoolArray, rng: np.random.Generator) -> tuple[int, int] | None:
    """Top left corner of a square round a random hole pixel, whose hole has a fitting share; None if none is found."""
    rows, columns = np.nonzero(hole)
    for _ in range(12):
        at = int(rng.integers(len(rows)))
        corner = [
            int(np.clip(place[at] - rng.integers(SIDE), 0, length - SIDE))
            for place, length in zip((rows, columns), hole.shape)
        ]
        share = hole[corner[0] : corner[0] + SIDE, corner[1] : corner[1] + SIDE].mean()
        if HOLE_SHARE[0] <= share <= HOLE_SHARE[1]:
            return corner[0], corner[1]
    return None


def planes_of(asked: FillTask) -> GuessCrop:
    """The whole view as one crop."""
    view, truth = asked.view, asked.truth
    guesses = make_guesses(view, asked.context, 0, tuple(GUESSES.values()))
    scale = depth_scale(view)
    context = np.stack([*context_planes(view, scale)], dtype=np.float32, casting="unsafe")
    depths = [context[3], *(nearness(one.inverse_depth, scale) for one in guesses)]
    known = (truth.depth > 0) & asked.depth_true
    return GuessCrop(
        context=np.round(context * 255).astype(np.uint8),
        color=np.stack([one.color.transpose(2, 0, 1) for one in guesses]),
        depth=np.round(np.stack(depths) * LEVELS).astype(np.uint16),
        true_color=np.where(view.color_hole[..., None], truth.color, view.color).transpose(2, 0, 1),
        true_depth=np.round(nearness(inverse_depth(truth.depth), scale) * LEVELS).astype(np.uint16),
        true_known=known.astype(np.uint8),
    )


def _cut_square(whole: GuessCrop, top: int, left: int) -> GuessCrop:
    box = np.s_[..., top : top + SIDE, left : left + SIDE]
    return GuessCrop(**{one.name: np.ascontiguousarray(getattr(whole, one.name)[box]) for one in fields(whole)})
