"""A scene and one more frame in; the scene that both show out, also where the scene was filled or lacks a removed object."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.geometry.frames.agreement import AGREES
from dlama.geometry.frames.gathering import FrameSource, gathered, view_of
from dlama.geometry.frames.removal import mask_growth, points_of, removed_from, removed_part
from dlama.geometry.frames.stored import PixelCache, StoredView
from dlama.geometry.holes import dilated
from dlama.geometry.projection import pixels_of
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import HoleType, Origin, View


def add_frame(scene: Scene, frame: FrameSource) -> Scene:
    """As `Scene.with_frame`."""
    caches = [one.cache for one in scene.frames if isinstance(one, StoredView)]
    numbers = (*scene.numbers, max(scene.numbers) + 1)
    names = [f"frame {number}" for number in numbers]
    view = view_of(frame, names[-1], caches[0] if caches else PixelCache())
    measured = gathered([*scene.unfilled.frames, view], names)
    if len(scene.frames) not in measured.numbers:
        return scene
    objects = removed_from(scene, view)
    kept, removals = view, scene.removals
    if objects.any():
        larger = dilated(objects, mask_growth(scene).px)
        kept, removals = view.without(larger, HoleType.OBJECT), (*removals, removed_part(view, objects, larger))
    frames = (*(without_seen_depth(one, view) for one in scene.frames), kept)
    fills = (without_seen(one, view) for one in scene.fills)
    return dataclasses.replace(
        measured,
        frames=tuple(frames[place] for place in measured.numbers),
        removals=removals,
        fills=tuple(fill for fill in fills if contribution(fill).any() or fill.far.any()),
        numbers=tuple(numbers[place] for place in measured.numbers),
    )


def without_seen(fill: View, frame: View) -> View:
    """A fill without what was filled where the frame measured."""
    seen = shown_by(frame, fill) & np.isin(fill.origin, (Origin.FILLED, Origin.DEPTH_FILLED))
    return fill.without(seen, HoleType.NONE) if seen.any() else fill


def without_seen_depth(one: View, frame: View) -> View:
    """A frame whose sensor holes are open again where their filled depth lies where another frame measured."""
    if not one.has_filled_depth:
        return one
    seen = shown_by(frame, one) & (one.origin == Origin.DEPTH_FILLED)
    return one.left_open(seen) if seen.any() else one


def shown_by(frame: View, layer: View) -> BoolArray:
    """H x W, True at the points of a layer that lie on what a frame measured, or in front of it."""
    row, column, z, inside = pixels_of(points_of(layer), frame.camera)
    there = np.where(frame.hole, 0, frame.depth)[row, column]
    return layer.valid & inside & (z <= there * (1 + AGREES))
