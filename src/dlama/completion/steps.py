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

from dlama.completion.start import NO_DILATION, Dilation, Plan
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin, has_code
from dlama.geometry.frames.choosing import choose_frames
from dlama.geometry.fusion import fuse
from dlama.geometry.holes import box_around, dilate_view_holes
from dlama.geometry.rendering import render, render_fills
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law, project_depth
from dlama.inpainters.confidence import LARGEST_CONFIDENCE
from dlama.inpainters.filling import FillReport, inpaint, paste_part
from dlama.progress import begin_stage

NOTHING_FILLED = FillReport(0, 0, 0, {})
SEEN_AGAIN = (Origin.REPROJECTED, Origin.ESTIMATED)
"""Origins of what the source view shows, seen from elsewhere."""


class Step(NamedTuple):
    """One view to be completed."""

    camera: Camera
    place: int | None = None
    """Of the frame in whose camera it is; None: another camera."""


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


def fill(plan: Plan, view: View) -> tuple[View, FillReport]:
    """The view with all its holes filled under the plan's law, and what that did."""
    return inpaint(view, plan.inpainter, plan.context, plan.seed)


def frame_steps(plan: Plan, scene: Scene, cameras: Sequence[Camera]) -> list[Step]:
    """The frames to fill first, of those that matter for `cameras` (all, where there are none), as the recipe says.

    Where an object is removed, those come first that see most of what no frame shows behind it.
    """
    frames = scene.frames
    chosen = {place for camera in cameras for place in choose_frames(frames, camera)} if cameras else range(len(frames))
    places = sorted(place for place in chosen if frames[place].has_holes) if plan.recipe.source_first else []
    if len(places) > 1 and scene.removals:
        unseen = {place: count_unseen_behind(plan, frames[place].camera) for place in places}
        places.sort(key=lambda place: (-unseen[place], place))
    return [Step(frames[place].camera, place) for place in places]


def count_unseen_behind(plan: Plan, camera: Camera) -> int:
    """Pixels of a frame behind a removed object that no other frame shows."""
    view = measured_view(plan, plan.given, camera)
    return int((view.hole & (view.hole_type == HoleType.OBJECT.value)).sum())


def measured_view(plan: Plan, scene: Scene, camera: Camera) -> View:
    """What the measurements alone show from `camera`: I', lambda' and M (eq. 2-4).

    Away from the source cameras the depth of sensor holes, filled there (in `scene`), counts as measured.
    """
    home = any(camera.same_view_as(one.camera) for one in plan.given.frames)
    frames = plan.given.frames if home else scene.frames
    view = render(dataclasses.replace(plan.given, frames=frames), camera, plan.recipe.mode, close=False)
    if plan.recipe.footprint and plan.given.removals:
        first, *others = plan.given.removals
        object_seen = render(Scene((first,), fills=tuple(others)), camera, plan.recipe.mode, types=False)
        view = view.without(~object_seen.hole & ~view.hole, HoleType.OBJECT)
    return view


def warp(plan: Plan, scene: Scene, camera: Camera) -> tuple[View, Dilation]:
    """The same with the hole dilated as the recipe says."""
    view = measured_view(plan, scene, camera)
    larger = dilate_view_holes(view, plan.recipe.dilate_holes)
    return larger, Dilation(int(view.hole.sum()), int((larger.hole & ~view.hole).sum()))


def show_earlier_fill(plan: Plan, scene: Scene, before: View) -> tuple[View, FillReport]:
    """The view with its holes closed where `scene` was filled for a frame or for earlier cameras, and what that did."""
    if scene is plan.given or not before.hole.any():
        return before, NOTHING_FILLED
    home = any(before.camera.same_view_as(one.camera) for one in plan.given.frames)
    if not (scene.fills or home or plan.recipe.dilate_holes or plan.recipe.footprint):
        return before, NOTHING_FILLED  # `before` was drawn of the same frames
    law = plan.context.near(before.camera).law
    if len(scene.frames) > 1 or not all(layer.camera.same_view_as(before.camera) for layer in scene.layers):
        again = home or bool(plan.recipe.dilate_holes or plan.recipe.footprint)  # else `before` shows the same frames
        earlier = render_fills(scene, before.camera, plan.recipe.mode, before.hole, frames=again)
        return close_holes(law, before, earlier)
    rows, columns = box_around(before.hole, 0)  # nothing moves: all else would be drawn in vain
    part = before.cropped(rows, columns)
    frames, fills = (tuple(one.load().cropped(rows, columns) for one in of) for of in (scene.frames, scene.fills))
    earlier = render(Scene(frames, fills=fills), part.camera, plan.recipe.mode, types=False, close=False)
    closed, report = close_holes(law.cropped(before, rows, columns), part, earlier)
    return paste_part(before, closed, rows, columns), report


def close_holes(law: Law, view: View, earlier: View, *, measured: bool = False) -> tuple[View, FillReport]:
    """The holes of a view closed with another rendering of the same camera, where that knows more, and what that did.

    Colours that were measured stay. Surfaces are drawn between lawful pixel centres, so the depth that is taken over is
    projected onto the law once more. measured: what `earlier` shows of measurements stays marked as such (REPROJECTED).
    """
    closed = view.hole & ~earlier.hole
    depth, moved = project_depth(view, np.where(closed, earlier.depth, view.depth), closed, law)
    of_color = closed & view.color_hole
    again = has_code(earlier.origin, *SEEN_AGAIN) & (not measured)
    origin = np.where(of_color, np.where(again, np.uint8(Origin.FILLED), earlier.origin), np.uint8(Origin.DEPTH_FILLED))
    known = view.with_planes(
        color=np.where(of_color[..., None], earlier.color, view.color),
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
    return known, FillReport(0, moved, 0, {})


def fuse_new(scene: Scene, before: View, known: View, filled: View) -> Scene:
    """The scene with what was filled anew; holes of `before` that `known` had closed already come from the scene itself."""
    return fuse(scene, filled, before.hole & ~known.hole)


def complete_step(
    plan: Plan, scene: Scene, step: Step, clock: Callable[[str], AbstractContextManager[Any]] = nullcontext
) -> tuple[CompletedView, Scene]:
    """The view of a step, completed, and the scene with what was filled for it. clock: counts seconds by stage."""
    if step.place is None:
        return complete_view(plan, scene, step.camera, clock)
    with clock("fill"):
        return complete_frame(plan, scene, step.place)


def complete_frame(plan: Plan, scene: Scene, place: int) -> tuple[CompletedView, Scene]:
    """One frame, completed after what other frames and earlier fills show of it; and the scene, in which it has depth wherever it
    has a colour."""
    begin_stage(f"fill frame {scene.numbers[place]}")
    frame = scene.frames[place].load()
    before = measured_view(plan, scene, frame.camera)
    known, taken_over = show_earlier_fill(plan, scene, before)
    view, filled = fill(plan, known)
    colored = frame.depth_hole
    if colored.any():
        frames = (*scene.frames[:place], frame.with_pixels(view, colored), *scene.frames[place + 1 :])
        scene = dataclasses.replace(scene, frames=frames)
    return CompletedView(before, view, NO_DILATION, (taken_over, filled)), fuse_new(scene, before, known, view)


def complete_view(
    plan: Plan, scene: Scene, camera: Camera, clock: Callable[[str], AbstractContextManager[Any]] = nullcontext
) -> tuple[CompletedView, Scene]:
    """The view of one camera, completed, and the scene with what was filled for it. clock: counts seconds by stage."""
    with clock("render"):
        before, grown_hole = warp(plan, scene, camera)
        known, taken_over = show_earlier_fill(plan, scene, before)
    with clock("fill"):
        view, filled = fill(with_aligned_edges(plan, scene, camera), known)
    with clock("fuse"):
        larger = fuse_new(scene, before, known, view)
    return CompletedView(before, view, grown_hole, (taken_over, filled)), larger


def with_aligned_edges(plan: Plan, scene: Scene, camera: Camera) -> Plan:
    """The plan with the context for a camera, depth edges where the pictures have them (`FillContext.with_aligned_edges`)."""
    return dataclasses.replace(plan, context=plan.context.near(camera).with_aligned_edges(scene))
