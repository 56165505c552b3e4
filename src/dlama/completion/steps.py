"""The steps of the method, each a function from values to new values: `pipeline`, `paths` and `stereo` put them in order.

fill each frame -> warp, mask (eq. 2-4) -> earlier fill -> fill (sec. 3.3) -> fuse (eq. 10)

A frame lacks depth where its sensor gave none, and all of what is behind a removed object. What another frame measured there is
used (`geometry.frames`); the rest is filled in the frame that sees most of it, and carried to the others.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, NamedTuple

import numpy as np

from dlama.completion.second_estimate import estimate_again
from dlama.completion.start import NO_DILATION, Dilation, Plan
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin, has_code
from dlama.geometry.frames.choosing import choose_frames
from dlama.geometry.fusion import fuse
from dlama.geometry.holes import box_around, dilate_mask, fill_with_nearest
from dlama.geometry.rendering import Mode, render, render_fills
from dlama.geometry.rgbd import replace_pixels
from dlama.geometry.scene import Scene, replace_frame
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.confidence import LARGEST_CONFIDENCE
from dlama.inpainters.filling import FillReport, inpaint, paste_part
from dlama.progress import begin_stage

StageClock = Callable[[str], AbstractContextManager[Any]]
"""Counts the seconds of the stage of that name."""
SEEN_AGAIN = (Origin.REPROJECTED, Origin.ESTIMATED)
"""Origins of what the source view shows, seen from elsewhere."""


class CompletedView(NamedTuple):
    """The view of one camera before and after."""

    before: View
    """What the measurements show of it, holes typed."""
    view: View
    """Completed."""
    grown: Dilation
    """How its hole grew."""
    reports: tuple[FillReport, FillReport]
    """Of what earlier views had filled already, and of what was filled anew."""


def fill(plan: Plan, view: View, scene: Scene | None = None) -> tuple[View, FillReport]:
    """The view with all its holes filled under the plan's law, and what that did.

    scene: whose depth edges count where its frames are drawn with them (`FillContext.with_aligned_edges`); None: as measured.
    """
    context = plan.context if scene is None else plan.context.near(view.camera).with_aligned_edges(scene)
    return inpaint(view, plan.inpainter, context, plan.seed)


def frames_to_fill(plan: Plan, scene: Scene, cameras: Sequence[Camera]) -> list[int]:
    """Places of the frames to fill first, of those that matter for `cameras` (all, where there are none), as the recipe says.

    Where an object is removed, those come first that see most of what no frame shows behind it.
    """
    if not plan.recipe.source_first:
        return []
    frames = scene.frames
    chosen = {place for camera in cameras for place in choose_frames(frames, camera)} if cameras else range(len(frames))
    places = sorted(place for place in chosen if frames[place].has_holes)
    if len(places) > 1 and scene.removals:
        behind = {place: measured_view(plan, plan.measured, frames[place].camera).object_hole for place in places}
        unseen = {place: int(hole.sum()) for place, hole in behind.items()}
        places.sort(key=lambda place: (-unseen[place], place))
    return places


def measured_view(plan: Plan, scene: Scene, camera: Camera) -> View:
    """What the measurements alone show from `camera`: I', lambda' and M (eq. 2-4).

    Away from the source cameras the depth of sensor holes, filled there (in `scene`), counts as measured.
    """
    frames = plan.measured.frames if plan.is_of_frame(camera) else scene.frames
    view = render(dataclasses.replace(plan.measured, frames=frames), camera, plan.recipe.mode, close=False)
    if plan.recipe.footprint and plan.measured.removals:
        first, *others = plan.measured.removals
        object_seen = render(Scene((first,), fills=tuple(others)), camera, plan.recipe.mode, types=False)
        view = view.without(~object_seen.hole & ~view.hole, HoleType.OBJECT)
    return view


def dilate_holes(view: View, radius: int) -> tuple[View, Dilation]:
    """The view with its holes dilated by `radius` px, and how they grew; a pixel given up takes the type of the nearest one."""
    given_up = dilate_mask(view.hole, radius) & ~view.hole
    grown = Dilation(int(view.hole.sum()), int(given_up.sum()))
    if not given_up.any():
        return view, grown
    larger = view.without(given_up, HoleType.DISOCCLUDED)
    types = np.where(given_up, fill_with_nearest(view.hole_type, view.hole), view.hole_type)
    return dataclasses.replace(larger, hole_type=types), grown


def show_earlier_fill(plan: Plan, scene: Scene, view: View) -> tuple[View, FillReport]:
    """The view with its holes closed where `scene` was filled for a frame or for earlier cameras, and what that did."""
    recipe = plan.recipe
    redrawn = (
        plan.is_of_frame(view.camera) or recipe.dilate_holes > 0 or recipe.footprint
    )  # else `view` shows these frames
    if scene is plan.measured or not view.hole.any() or not (scene.fills or redrawn):
        return view, FillReport(0, 0, 0, {})
    law = plan.context.near(view.camera).law
    if len(scene.frames) == 1 and all(layer.camera.same_view_as(view.camera) for layer in scene.layers):
        return show_fill_in_place(law, scene, view, recipe.mode)
    return close_holes(law, view, render_fills(scene, view.camera, recipe.mode, view.hole, frames=redrawn))


def show_fill_in_place(law: Law, scene: Scene, view: View, mode: Mode) -> tuple[View, FillReport]:
    """As `show_earlier_fill` of a scene all of whose layers are of the view's own camera: the box of its holes is drawn alone."""
    rows, columns = box_around(view.hole, 0)
    part = view.cropped(rows, columns)
    frames, fills = (tuple(one.load().cropped(rows, columns) for one in of) for of in (scene.frames, scene.fills))
    earlier = render(Scene(frames, fills=fills), part.camera, mode, types=False, close=False)
    closed, report = close_holes(law.cropped(view, rows, columns), part, earlier)
    return paste_part(view, closed, rows, columns), report


def close_holes(law: Law, view: View, earlier: View, *, measured: bool = False) -> tuple[View, FillReport]:
    """The holes of a view closed with another rendering of the same camera, where that knows more, and what that did.

    Colours that were measured stay. Surfaces are drawn between lawful pixel centres, so the depth that is taken over is
    projected onto the law once more. measured: what `earlier` shows of measurements stays marked as such (REPROJECTED).
    """
    closed = view.hole & ~earlier.hole
    depth, moved = law.project(view.camera, np.where(closed, earlier.depth, view.depth), closed)
    of_color = closed & view.color_hole
    again = has_code(earlier.origin, *SEEN_AGAIN) & (not measured)
    origin = np.where(of_color, np.where(again, np.uint8(Origin.FILLED), earlier.origin), np.uint8(Origin.DEPTH_FILLED))
    known = view.with_planes(
        color=replace_pixels(view.color, of_color, earlier.color),
        depth=depth,
        hole=view.hole & ~closed,
        origin=np.where(closed, origin, view.origin),
        confidence=np.where(
            closed, np.where(again, np.float32(LARGEST_CONFIDENCE), earlier.confidence), view.confidence
        ),
        errors=view.errors_with(earlier, closed),
    )
    if view.frame is not None and earlier.frame is not None:
        known = known.with_planes(frame=np.where(of_color, earlier.frame, view.frame))
    return known, FillReport(0, int(moved.sum()), 0, {})


def complete_frame(
    plan: Plan, scene: Scene, place: int, clock: StageClock = nullcontext
) -> tuple[CompletedView, Scene]:
    """One frame, completed after what other frames and earlier fills show of it; and the scene, in which it has depth wherever it
    has a colour. clock: counts seconds by stage."""
    with clock("fill"):
        begin_stage(f"fill frame {scene.numbers[place]}")
        frame = scene.frames[place].load()
        before = measured_view(plan, scene, frame.camera)
        known, taken_over = show_earlier_fill(plan, scene, before)
        view, filled = fill(plan, known)
        colored = frame.depth_hole
        if colored.any():
            scene = replace_frame(scene, place, frame.with_pixels(view, colored))
        larger = fuse(scene, view, before.hole & ~known.hole)
    return CompletedView(before, view, NO_DILATION, (taken_over, filled)), larger


def complete_view(
    plan: Plan, scene: Scene, camera: Camera, clock: StageClock = nullcontext
) -> tuple[CompletedView, Scene]:
    """The view of one camera, completed, and the scene with what was filled for it. clock: counts seconds by stage."""
    with clock("render"):
        before, grown = dilate_holes(measured_view(plan, scene, camera), plan.recipe.dilate_holes)
        known, taken_over = show_earlier_fill(plan, scene, before)
    with clock("fill"):
        view, filled = fill(plan, known, scene)
    with clock("fuse"):
        larger = fuse(scene, view, before.hole & ~known.hole)
    return CompletedView(before, view, grown, (taken_over, filled)), larger


def complete_views(
    plan: Plan, scene: Scene, cameras: Sequence[Camera], clock: StageClock, *, again: bool
) -> tuple[list[CompletedView], list[FillReport], Scene]:
    """The views of cameras, each of which sees what was filled before; the reports of all that was filled, frames first; and the
    scene with it. again: whether estimated depth behind removed objects is estimated again (`second_estimate`)."""
    completed: list[CompletedView] = []
    fills: list[FillReport] = []
    for place in frames_to_fill(plan, scene, cameras):
        found, scene = complete_frame(plan, scene, place, clock)
        fills += found.reports
        if again and found.reports[1].hole_pixels:
            with clock("fill"):
                plan, scene, report = estimate_again(plan, scene, place, found.view)
            fills.append(report)
        del found  # the scene holds what was filled
    for camera in cameras:
        found, scene = complete_view(plan, scene, camera, clock)
        fills += found.reports
        completed.append(found)
    return completed, fills, scene
