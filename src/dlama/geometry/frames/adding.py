"""A scene and one more frame in; the scene with the frame out, also where it was filled or lacks a removed object."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.geometry.frames.agreement import AGREES
from dlama.geometry.frames.gathering import FrameSource, gather_views, open_view
from dlama.geometry.frames.removal import find_removed, mask_growth, part_under_mask, world_points
from dlama.geometry.frames.stored import PixelCache, StoredView
from dlama.geometry.holes import dilate_mask
from dlama.geometry.projection import project_to_pixels
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import HoleType, Origin, View


def add_frame(scene: Scene, frame: FrameSource) -> Scene:
    """As `Scene.with_frame`."""
    caches = [one.cache for one in scene.frames if isinstance(one, StoredView)]
    numbers = (*scene.numbers, max(scene.numbers) + 1)
    names = [f"frame {number}" for number in numbers]
    view = open_view(frame, names[-1], caches[0] if caches else PixelCache())
    measured = gather_views([*scene.unfilled.frames, view], names)
    if len(scene.frames) not in measured.numbers:
        return scene
    objects = find_removed(scene, view)
    kept, removals = view, scene.removals
    if objects.any():
        larger = dilate_mask(objects, mask_growth(scene).px)
        kept, removals = view.without(larger, HoleType.OBJECT), (*removals, part_under_mask(view, objects, larger))
    frames = (*(drop_seen_depth(one, view) for one in scene.frames), kept)
    fills = (drop_seen_fill(one, view) for one in scene.fills)
    return dataclasses.replace(
        measured,
        frames=tuple(frames[place] for place in measured.numbers),
        removals=removals,
        fills=tuple(fill for fill in fills if contribution(fill).any() or fill.far.any()),
        numbers=tuple(numbers[place] for place in measured.numbers),
    )


def drop_seen_fill(fill: View, frame: View) -> View:
    """A fill without the pixels that the frame measured."""
    seen = is_seen_by(frame, fill) & np.isin(fill.origin, (Origin.FILLED, Origin.DEPTH_FILLED))
    return fill.without(seen, HoleType.NONE) if seen.any() else fill


def drop_seen_depth(one: View, frame: View) -> View:
    """A frame with its filled sensor holes open again where another frame measured their depth."""
    if not one.has_filled_depth:
        return one
    seen = is_seen_by(frame, one) & (one.origin == Origin.DEPTH_FILLED)
    return one.reopen(seen) if seen.any() else one


def is_seen_by(frame: View, layer: View) -> BoolArray:
    """H x W, True at points of a layer on a surface that a frame measured, or in front of it."""
    row, column, z, inside = project_to_pixels(world_points(layer), frame.camera)
    there = np.where(frame.hole, 0, frame.depth)[row, column]
    return layer.valid & inside & (z <= there * (1 + AGREES))
