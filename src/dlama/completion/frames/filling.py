"""A scene of many frames and the cameras asked for in; the scene with what their frames lack filled, each thing once, out.

A frame lacks depth where its sensor gave none, and all of what is behind a removed thing. What another frame measured there is
used (`geometry.frames`); the rest is filled in the frame that sees most of it, and carried to the others.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Sequence

import numpy as np

from dlama.completion.steps import Plan, fill, fill_source, fuse_new, show_earlier_fill, warp
from dlama.geometry.camera import Camera
from dlama.geometry.frames.choosing import choose_frames
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, Origin, View
from dlama.inpainters.filling import FillReport

LOG = logging.getLogger("dlama")


def fill_first(plan: Plan, start: Scene, cameras: Sequence[Camera]) -> tuple[Scene, tuple[FillReport, ...]]:
    """The given scene with what its own pictures lack filled, before any camera moves; `start` itself, if it was completed before
    and nothing has been taken out since."""
    if len(start.layers) > len(start.measured) and not len(plan.given.objects) > len(start.objects):
        return start, ()
    return fill_frames(plan, cameras) if plan.given.numbers else fill_source(plan)


def fill_frames(plan: Plan, cameras: Sequence[Camera]) -> tuple[Scene, tuple[FillReport, ...]]:
    """The given scene with the frames that matter for `cameras` (all, where there are none) filled as the recipe says."""
    scene, reports = plan.given, []
    if not plan.recipe.source_first:
        return scene, ()
    for place in filling_order(plan, cameras):
        scene, report = fill_frame(plan, scene, place)
        reports += report
    return scene, tuple(reports)


def filling_order(plan: Plan, cameras: Sequence[Camera]) -> list[int]:
    """Places of the frames to fill; where a thing is removed, those first that see most of what no frame shows behind it."""
    frames = plan.given.measured
    wanted = {place for camera in cameras for place in choose_frames(frames, camera)} if cameras else range(len(frames))
    places = sorted(place for place in wanted if frames[place].has_holes)
    if not plan.given.objects:
        return places
    unseen = {place: unseen_behind(plan, frames[place].camera) for place in places}
    return sorted(places, key=lambda place: (-unseen[place], place))


def unseen_behind(plan: Plan, camera: Camera) -> int:
    """Pixels of a frame behind a removed thing that no other frame shows."""
    view = warp(plan, plan.given, camera)[0]
    return int((view.hole & (view.hole_type == HoleType.OBJECT)).sum())


def fill_frame(plan: Plan, scene: Scene, place: int) -> tuple[Scene, list[FillReport]]:
    """The scene with one frame's holes filled, after what other frames and earlier fills show there."""
    scene, _, reports = completed_frame(plan, scene, place)
    return scene, reports


def completed_frame(plan: Plan, scene: Scene, place: int) -> tuple[Scene, View, list[FillReport]]:
    """The same, and the completed view of the frame's own camera."""
    LOG.info("fill frame %d", (plan.given.numbers or (0,))[place])
    before, _ = warp(plan, scene, plan.given.layers[place].camera)
    known, taken_over = show_earlier_fill(plan, scene, before)
    view, filled = fill(plan, known)
    return fuse_new(with_depth_of(scene, place, view), before, known, view), view, [taken_over, filled]


def with_depth_of(scene: Scene, place: int, view: View) -> Scene:
    """The scene whose frame has depth wherever it has a colour, as of `view`, which is that frame completed."""
    frame = scene.layers[place]
    colored = frame.hole & (frame.origin == Origin.DEPTH_FILLED)
    if not colored.any():
        return scene
    layer = dataclasses.replace(
        frame,
        depth=np.where(colored, view.depth, frame.depth),
        hole=frame.hole & ~colored | (colored & view.hole),
        origin=np.where(colored & ~view.hole, view.origin, frame.origin),
        confidence=np.where(colored, view.confidence, frame.confidence),
    )
    return dataclasses.replace(scene, layers=(*scene.layers[:place], layer, *scene.layers[place + 1 :]))
