"""Posed RGB-D frames of one scene in; one Scene of them out, with the gain of each and the noise of all; bad ones named.

One more frame for a scene in; the scene with it out, also where it was filled or lacks a removed object.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from itertools import count

import numpy as np

from dlama.arguments import check_arguments
from dlama.errors import InputError, InputTypeError, check_same_size, warn
from dlama.geometry.camera import Float64Array
from dlama.geometry.codes import HoleType, Origin, from_filler
from dlama.geometry.frames.agreement import (
    AGREES,
    ENOUGH,
    SAME_GAIN,
    Overlap,
    fit_gains,
    fit_noise,
    make_comparable,
    measure_overlaps,
)
from dlama.geometry.frames.removal import crop_layer, mask_growth, part_under_mask
from dlama.geometry.frames.stored import Layer, PixelCache, StoredView, cache_of, coarse_depth
from dlama.geometry.holes import dilate_mask
from dlama.geometry.projection import project_to_pixels, world_points
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene, contribution, name_of_number
from dlama.geometry.view import View
from dlama.progress import Progress, begin_stage, take_progress

OUTLIER = 0.5
"""A frame is an outlier if it agrees with the others so many times less than their median does. Frames of which fewer points than
this share lie on common surfaces contradict one another: recorded ones have 0.9 and more, poses read in a wrong convention less
than 0.45."""


FrameSource = RGBD | Callable[[], RGBD]
"""A frame, or what reads it: a function without arguments, which is called again when its pixels are needed again."""


@take_progress
def scene(
    frames: Sequence[FrameSource], *, names: Sequence[str] | None = None, progress: Progress | None = None
) -> Scene:
    """The scene that several posed frames show, in their one world. One frame gives the scene of one picture.

    Its views come from all frames: depths within the measured noise are one surface, a point that as many frames saw through
    as saw it is dropped, and colours are brought to one brightness. What is wrong with single frames is warned of, and they are
    left out: the same picture from the same place twice, a pose that contradicts all others. Frame numbers (`Scene.numbers`,
    `View.frame`) count the frames as given, from 0.

    Args:
        frames: Pictures with metric depth, of one size; their cameras stand in one world. In the place of a picture a function
            that reads it: then only some 90 pictures of 640x480 are in memory at a time, however many there are.
        names: What messages and files call them (`Scene.names`); by default they have their numbers.
        progress: Called with the name of each stage as it begins; what it raises ends the work.
    Raises:
        InputError: no frame, a name twice, frames of different sizes (ShapeError), or of which no two show the same surfaces.
    """
    check_arguments(scene, locals())
    called = [f"frame {number}" for number in range(len(frames))] if names is None else list(names)
    if not frames:
        raise InputError("`frames` is empty; one posed RGB-D frame or more is expected")
    if len(called) != len(frames):
        raise InputError(f"names has {len(called)} names for {len(frames)} frames; as many are expected")
    if twice := [name for name, times in Counter(called).items() if times > 1]:
        raise InputError(f"names has {twice[0]!r} twice; a name of its own is expected for each frame")
    cache, views = PixelCache(), list[Layer]()
    for number, (frame, name) in enumerate(zip(frames, called)):
        begin_stage(f"read frame {number + 1} of {len(frames)}")
        views.append(open_view(frame, name, cache))
    found = gather_views(views, called)
    if names is None:
        return found
    return dataclasses.replace(found, names=tuple(called[number] for number in found.numbers))


def open_view(frame: FrameSource, name: str, cache: PixelCache) -> Layer:
    """The source view of a frame, held in the cache where it can be read again. InputError: no depth."""
    if not isinstance(frame, RGBD) and not callable(frame):
        raise InputTypeError(
            f"{name} is of type {type(frame).__name__}; an RGBD (a picture with depth) is expected, or what reads one"
        )
    first = View.from_rgbd(read_frame(frame, name))
    if not first.shows_source:
        raise InputError(f"{name} has no depth at all; leave it out")
    if isinstance(frame, RGBD):
        return first
    view = StoredView(first.camera, partial(_source_view, frame), cache, first)
    view.find_once(make_comparable), view.find_once(coarse_depth)
    return view


def read_frame(frame: FrameSource, name: str) -> RGBD:
    """The frame, read where it is a function that reads it. InputTypeError, which calls it `name`: that gave none."""
    found = frame if isinstance(frame, RGBD) else frame()
    if not isinstance(found, RGBD):
        raise InputTypeError(
            f"what reads {name} gave a {type(found).__name__}; an RGBD (a picture with depth) is expected"
        )
    return found


def _source_view(frame: Callable[[], RGBD]) -> View:
    return View.from_rgbd(frame())


def gather_views(views: Sequence[Layer], called: Sequence[str]) -> Scene:
    """The scene of the frames' source views; `called`: their names. As `scene`."""
    for view, name in zip(views, called):
        check_same_size(name, view.camera.hw, called[0], views[0].camera.hw)
    kept = _drop_duplicates(views, called)
    if len(kept) == 1:
        return Scene((views[kept[0]],), numbers=(kept[0],))
    begin_stage("compare frames")
    pairs = measure_overlaps([views[place] for place in kept])
    found = {(kept[i], kept[j]): each for (i, j), each in pairs.items()}
    kept = _drop_outliers(kept, found, called)
    row = {place: number for number, place in enumerate(kept)}
    left = {(row[i], row[j]): each for (i, j), each in found.items() if i in row and j in row}
    gains = fit_gains(len(kept), left)
    same = (np.abs(gains - 1) < SAME_GAIN).all()
    return Scene(
        tuple(views[place] for place in kept),
        numbers=tuple(kept),
        gains=() if same else tuple((float(r), float(g), float(b)) for r, g, b in gains),
        noise=fit_noise(list(left.values())),
    )


def _drop_duplicates(views: Sequence[Layer], called: Sequence[str]) -> list[int]:
    """Places of the frames, each picture once."""
    poses = np.stack([view.camera.world_from_cam for view in views])
    kept: list[int] = []
    for place, view in enumerate(views):
        near = np.abs(poses[kept] - poses[place]).max((1, 2), initial=0) <= 1e-6
        alike = (kept[row] for row in np.flatnonzero(near) if views[kept[row]].camera.same_view_as(view.camera))
        twin = next((one for one in alike if np.array_equal(views[one].load().color, view.load().color)), None)
        if twin is None:
            kept.append(place)
        else:
            warn(f"{called[place]} is {called[twin]} once more; it is left out")
    return kept


def _drop_outliers(kept: list[int], found: dict[tuple[int, int], Overlap], called: Sequence[str]) -> list[int]:
    """The frames that some other one confirms; those that contradict all others, or meet none, are named. All where most of them
    contradict one another, of which one message warns."""
    if not any(each.agree >= ENOUGH for each in found.values()):
        raise InputError(
            f"no two of the {len(kept)} frames show the same surfaces: are the poses camera-to-world, in metres, and of the same "
            "scene as the depth? Depth of single readings, as of a LIDAR, must be filled between them: `dlama.densify`"
        )
    every, noted = kept, list[str]()
    while len(kept) > 2:
        shares = _share_agreeing(kept, found)
        if np.isnan(shares).all():
            break
        worst = int(np.nanargmin(shares))
        if shares[worst] >= OUTLIER * np.nanmedian(shares):
            break
        noted.append(
            f"{called[kept[worst]]} contradicts the others: {shares[worst]:.0%} of its points that they can see lie on their "
            f"surfaces, of the others' {np.nanmedian(shares):.0%}; it is left out, is its pose right?"
        )
        kept = [place for place in kept if place != kept[worst]]
    shares = _share_agreeing(kept, found)
    noted += [
        f"{called[place]} shows nothing that another frame shows"
        for place, share in zip(kept, shares)
        if np.isnan(share)
    ]
    agreeing = np.median(shares[shares >= 0]) if (shares >= 0).any() else 1.0
    if agreeing < OUTLIER:
        kept = every
        noted = [
            f"the frames contradict one another: {agreeing:.0%} of the points that two of them can see lie on the same surfaces; "
            "are the poses camera-to-world, with OpenCV's axes and in metres? `dlama doctor` names the usual mistakes"
        ]
    for each in noted:
        warn(each)
    return kept


def _share_agreeing(kept: Sequence[int], found: dict[tuple[int, int], Overlap]) -> Float64Array:
    """Of each frame: share of points on the other's surface, among those on it or seen through, both ways; NaN: none."""
    row = {place: number for number, place in enumerate(kept)}
    agree, through = np.zeros(len(kept)), np.zeros(len(kept))
    for pair, each in found.items():
        if pair[0] in row and pair[1] in row:
            for place in pair:
                agree[row[place]] += each.agree
                through[row[place]] += each.through
    total = agree + through
    return np.where(total >= ENOUGH, agree / np.maximum(total, 1), np.nan)


def add_frame(scene: Scene, frame: FrameSource, find_removed: Callable[[Scene, View], BoolArray]) -> Scene:
    """As `Scene.with_frame`. find_removed: H x W, where a further frame shows what was removed from a scene."""
    numbers = (*scene.numbers, max(scene.numbers) + 1)
    called = [f"frame {number}" for number in numbers]
    names = (*scene.names, next(name for name in map(name_of_number, count(numbers[-1])) if name not in scene.names))
    added = open_view(frame, called[-1], cache_of(scene.frames))
    measured = gather_views([*scene.unfilled.frames, added], called)
    if len(scene.frames) not in measured.numbers:
        return scene
    view = added.load()
    kept, removals = remove_again(scene, added, find_removed(scene, view))
    frames = (*(drop_seen_depth(one, view) for one in scene.frames), kept)
    fills = (drop_seen_fill(one, view) for one in scene.fills)
    return dataclasses.replace(
        measured,
        frames=tuple(frames[place] for place in measured.numbers),
        removals=(*scene.removals, *removals),
        fills=tuple(fill for fill in fills if adds_to_scene(fill)),
        numbers=tuple(numbers[place] for place in measured.numbers),
        names=tuple(names[place] for place in measured.numbers),
    )


def remove_again(scene: Scene, frame: Layer, objects: BoolArray) -> tuple[Layer, list[Layer]]:
    """A further frame without the removed `objects` (H x W) that it shows, and what of them it showed."""
    if not objects.any():
        return frame, []
    larger = dilate_mask(objects, mask_growth(scene).px)
    return frame.without(larger, HoleType.OBJECT), [crop_layer(part_under_mask(frame.load(), objects, larger), larger)]


def drop_seen_fill(fill: Layer, frame: View) -> Layer:
    """A fill without the pixels that the frame measured."""
    view = fill.load()
    seen = is_seen_by(frame, view) & from_filler(view.origin)
    return fill.without(seen, HoleType.NONE) if seen.any() else fill


def adds_to_scene(fill: Layer) -> bool:
    """Whether a fill holds points or sky of its own."""
    view = fill.load()
    return bool(contribution(view).any() or view.far.any())


def drop_seen_depth(one: Layer, frame: View) -> Layer:
    """A frame with its filled sensor holes open again where another frame measured their depth."""
    if not one.has_filled_depth:
        return one
    view = one.load()
    seen = is_seen_by(frame, view) & (view.origin == Origin.DEPTH_FILLED.value)
    return view.reopen(seen) if seen.any() else one


def is_seen_by(frame: View, view: View) -> BoolArray:
    """H x W, True at points of a layer on a surface that a frame measured, or in front of it."""
    row, column, z, inside = project_to_pixels(world_points(view), frame.camera)
    there = frame.known_depth[row, column]
    return view.valid & inside & (z <= there * (1 + AGREES))
