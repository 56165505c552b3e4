"""Procedural worlds in -> samples with exact truth out: of another view (kind `world`), with an object removed (`removal`), with
an object removed from both pictures of a pair (`stereo`).

Source frames are rendered or masked by the same code as at run time. Any object of a world may be removed; half the time it is
the object of interest. The truth behind it is cast through that one object, so its shadow stays, as it does in the known pixels.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dlama.geometry.codes import HoleType
from dlama.geometry.holes import box_around, dilate_mask, sides_of
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.training.data.augment import add_depth_faults
from dlama.training.data.masks import random_mask
from dlama.training.data.samples.views import PairExample, ViewExample, hole_size_fits
from dlama.training.data.samples.world_views import WorldSet, WorldViews

SENSOR_SHARE = 0.08
"""Probability of a sample whose holes are a frame's own missing depth."""
MOST_DILATION = 4
"""Pixels; object masks are dilated by 1 to so many, as before an object leaves the cloud."""
OBJECT_SHARE = (0.005, 0.25)
"""Least and largest share of the picture that a removed object covers."""


def world_view(worlds: WorldSet, index: int, rng: np.random.Generator) -> ViewExample:
    """Kind `world`: the view of another camera, known where the source frame, with sensor faults, shows it."""
    views = worlds.views(index)
    if rng.random() < SENSOR_SHARE:
        return sensor_hole_example(views.frame(views.pairs[index % len(views.pairs)][0]), rng)
    for number in range(len(views.pairs)):
        source, target = views.pairs[(index + number) % len(views.pairs)]
        rgbd = add_depth_faults(views.frame(source), rng)
        view = render(rgbd, views.cameras[target], types=False)
        if hole_size_fits(view.hole):
            return ViewExample(view, views.frame(target), Law.of(Scene((View.from_rgbd(rgbd),))))
    return mask_example(views.frame(0), random_mask(rng, views.cameras[0].hw))


def world_removal(worlds: WorldSet, index: int, rng: np.random.Generator) -> ViewExample:
    """Kind `removal`: a frame with an object's mask as its hole."""
    views = worlds.views(index)
    number = index % len(views.cameras)
    frame, removed = views.frame(number), removable_object(views, number, rng)
    if removed is None:
        return mask_example(frame, random_mask(rng, frame.camera.hw))
    (hole,) = dilate_equally([views.raycast(number).group == removed], rng)
    truth = frame_without(views, number, removed, hole)
    return mask_example(add_depth_faults(frame, rng), hole, truth)


def world_pair(worlds: WorldSet, index: int, rng: np.random.Generator) -> PairExample:
    """Kind `stereo`: both pictures of a pair with one object's masks as their holes."""
    views = worlds.stereo_views(index)
    ends = views.pairs[index % len(views.pairs)]
    frames, removed = [views.frame(number) for number in ends], removable_object(views, ends[0], rng)
    shown = [frame.color for frame in frames]
    holes = dilate_equally([views.raycast(number).group == removed for number in ends], rng)
    if removed is None:
        return PairExample(shown, shown, [random_mask(rng, frames[0].camera.hw)] * 2)
    true = [frame_without(views, number, removed, hole).color for number, hole in zip(ends, holes)]
    return PairExample(shown, true, holes)


def dilate_equally(masks: Sequence[BoolArray], rng: np.random.Generator) -> list[BoolArray]:
    """Masks (H x W) dilated by one random radius of 1 to MOST_DILATION pixels, as before an object leaves the cloud."""
    radius = int(rng.integers(1, MOST_DILATION + 1))
    return [dilate_mask(mask, radius) for mask in masks]


def sensor_hole_example(frame: RGBD, rng: np.random.Generator) -> ViewExample:
    """A frame with missing depth, at its own camera."""
    view = View.from_rgbd(add_depth_faults(frame, rng, sensor_holes=True))
    return ViewExample(view, frame, Law.of(Scene((view,))))


def mask_example(source: RGBD, removed: BoolArray, truth: RGBD | None = None) -> ViewExample:
    """A frame without the pixels of `removed` (H x W bool), at its own camera.

    truth: the frame without the object; the depth of the removed object then still limits what is filled (visibility law).
    Default: no object is removed, the truth is the frame itself.
    """
    view = View.from_rgbd(source)
    rest = view.without(removed, HoleType.OBJECT)
    objects = (view.without(~removed, HoleType.NONE),) if truth is not None else ()
    return ViewExample(rest, truth if truth is not None else source, Law.of(Scene((rest,), objects)))


def removable_object(views: WorldViews, number: int, rng: np.random.Generator) -> int | None:
    """Number of an object of OBJECT_SHARE that the picture of camera `number` does not cut off (but at the bottom); None if there
    is none."""
    group = views.raycast(number).group
    groups, counts = np.unique(group[group > 0], return_counts=True)
    low, high = (share * group.size for share in OBJECT_SHARE)
    cut_off = np.concatenate([group[0], group[:, 0], group[:, -1]])  # walls of rooms among them
    found = np.setdiff1d(groups[(counts >= low) & (counts <= high)], cut_off)
    if not len(found):
        return None
    preferred, chosen = views.world.object_index, int(found[rng.integers(len(found))])
    return preferred if preferred in found and rng.random() < 0.5 else chosen


def frame_without(views: WorldViews, number: int, removed: int, where: BoolArray) -> RGBD:
    """The frame of camera `number` with the pixels of `where` (H x W) as they are without object `removed`; its shadow stays."""
    frame = views.frame(number)
    if not where.any():  # only the other picture of the pair shows it
        return frame
    rows, columns = box = box_around(where, 0)
    height, width = sides_of(box)
    part = frame.camera.cropped(columns.start, rows.start, width, height)
    cast = views.world.raycast(part, through=np.where(where[box], removed, -1).astype(np.int32))
    color, depth = frame.color.copy(), frame.depth.copy()
    np.copyto(color[box], cast.color, where=where[box][..., None])
    np.copyto(depth[box], cast.depth, where=where[box])
    return RGBD(color, depth, frame.camera)
