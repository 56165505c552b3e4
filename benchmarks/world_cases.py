"""Procedural worlds as sensors see them: a number in; a view or the removal of an object in clutter, with its truth, out."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np

from dlama.datasets.frames import RemovalTruth, Truth, ViewTruth
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD
from dlama.perception.monocular import estimate_depth
from dlama.training.data.samples.world_views import WorldSet, WorldViews
from sensors import add_photo_noise, phone, scanning_lidar, stereo_matcher, structured_light, time_of_flight

SHARES, FARTHEST_M = (0.005, 0.12), 6.0
"""Of the picture, that the removed object of a world covers, and its largest distance (median depth): no houses."""
SENSORS = ("exact", "kinect", "matcher", "estimated")
"""Of the suite's worlds, in turn; `as_seen` also knows a phone, a lidar and a time-of-flight camera (tof)."""
MEASURE = {
    "kinect": structured_light,
    "matcher": stereo_matcher,
    "phone": phone,
    "lidar": scanning_lidar,
    "tof": time_of_flight,
}


def world_case(number: int, kind: str, sensor: str, worlds: WorldSet | None = None, pair: int = 0) -> Truth:
    """A world as a sensor sees it: a view of it, or an object in clutter removed.

    Args:
        number: of the world; the next one that fits is taken.
        kind: view or removal.
        sensor: as of `as_seen`.
        worlds: the set of worlds; None: the suite's own, 512 x 512.
        pair: which pair of cameras a view is of.

    The truth of a removal is free of the object's shadow, as it is in all recorded sets.
    """
    worlds = worlds or WorldSet("held_out", 512)
    rng = np.random.default_rng([number, 5])
    while True:
        views = worlds.views(number * worlds.group_size)
        removed = cluttered_object(views, 0) if kind == "removal" else 0
        if removed is not None and views.pairs:
            break
        number += 10_000
    source, target = (0, 0) if kind == "removal" else views.pairs[pair % len(views.pairs)]
    frame = as_seen(views.frame(source), sensor, rng)
    if kind == "view":
        return ViewTruth(frame, views.frame(target))
    mask = views.raycast(source).group == removed
    empty = dataclasses.replace(views.world, object_index=removed).frame(views.cameras[source], object=False)
    return RemovalTruth(frame, empty, mask)


def cluttered_object(views: WorldViews, camera: int) -> int | None:
    """The object of a fitting size with the most other objects right round it; None if there is none."""
    group, depth = views.raycast(camera).group, views.raycast(camera).depth
    groups, counts = np.unique(group[group > 1], return_counts=True)
    low, high = (share * group.size for share in SHARES)
    cut_off = np.concatenate([group[0], group[:, 0], group[:, -1]])
    fitting = np.setdiff1d(groups[(counts >= low) & (counts <= high)], cut_off)
    fitting = np.array([number for number in fitting if np.median(depth[group == number]) < FARTHEST_M])
    if not len(fitting):
        return None

    def neighbours(number: int) -> float:
        mask = group == number
        ring = dilate_mask(mask, 12) & ~mask
        return len(np.unique(group[ring])) + float(np.isin(group[ring], groups).mean())

    return int(max(fitting, key=neighbours))


def as_seen(frame: RGBD, sensor: str, rng: np.random.Generator) -> RGBD:
    """The frame as a sensor of that name gives it: one of SENSORS, phone or lidar."""
    if sensor == "exact":
        return frame
    frame = dataclasses.replace(frame, color=add_photo_noise(frame.color, rng))
    if sensor == "estimated":
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return scaled_estimate(frame)
    return MEASURE[sensor](frame, rng)


def scaled_estimate(frame: RGBD) -> RGBD:
    """Depth estimated from the picture, at the true scale (median)."""
    found = estimate_depth(frame.color, frame.camera).rgbd
    there = (frame.depth > 0) & np.isfinite(frame.depth) & (found.depth > 0) & np.isfinite(found.depth)
    factor = np.float32(np.median(frame.depth[there]) / np.median(found.depth[there])) if there.any() else np.float32(1)
    return dataclasses.replace(found, depth=found.depth * factor)
