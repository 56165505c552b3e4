"""The steps of the method, each a function from values to new values: `pipeline`, `photo3d` and `stereo` put them in order.

fill each frame -> warp, mask (eq. 2-4) -> earlier fill -> fill (sec. 3.3) -> fuse (eq. 10)

A frame lacks depth where its sensor gave none, and all of what is behind a removed object. What another frame measured there is
used (`geometry.frames`); the rest is filled in the frame that sees most of it, and carried to the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Any, NamedTuple

from dlama.completion.second_estimate import estimate_again
from dlama.completion.start import Plan
from dlama.geometry.camera import Camera
from dlama.geometry.frames.choosing import choose_frames, count_unseen
from dlama.geometry.frames.removal import NO_DILATION, Dilation
from dlama.geometry.fusion import close_by_earlier_fill, fuse
from dlama.geometry.rendering import dilate_holes, render_measured
from dlama.geometry.scene import Scene, replace_frame
from dlama.geometry.view import View
from dlama.inpainters.filling import FillReport, inpaint
from dlama.progress import begin_stage

COUNTED = 8
"""Frames whose unseen pixels are counted, a rendering each, before the first one is filled."""
StageClock = Callable[[str], AbstractContextManager[Any]]
"""Counts the seconds of the stage of that name."""


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


def frames_to_fill(plan: Plan, scene: Scene, cameras: Sequence[Camera]) -> list[int]:
    """Places of the frames to fill first, of those that matter for `cameras` (all, where there are none), as the recipe says.

    Where an object is removed, those come first that see most of what no frame shows behind it.
    """
    if not plan.recipe.source_first:
        return []
    frames = scene.frames
    chosen = {place for camera in cameras for place in choose_frames(frames, camera)} if cameras else range(len(frames))
    places = sorted(place for place in chosen if frames[place].has_holes)
    return order_by_unseen(plan, places) if len(places) > 1 and scene.removals else places


def order_by_unseen(plan: Plan, places: Sequence[int]) -> list[int]:
    """The frames in these places, those first that see most of what no frame shows behind removed objects: counted in pixels of
    the COUNTED that have most of it in their samples, and most of the objects."""
    measured, frames = plan.measured, plan.measured.frames
    cells = {place: count_unseen(frames, place) for place in places}
    first = sorted(places, key=lambda place: (*(-count for count in cells[place]), place))[:COUNTED]
    pixels = {}
    for place in first:
        shown = render_measured(measured, measured, frames[place].camera, plan.recipe.mode, plan.recipe.footprint)
        pixels[place] = int(shown.object_hole.sum())
    others = sorted(set(places) - set(first), key=lambda place: (-cells[place][0], place))
    return [*sorted(first, key=lambda place: (-pixels[place], place)), *others]


def complete_frame(
    plan: Plan, scene: Scene, place: int, clock: StageClock = nullcontext
) -> tuple[CompletedView, Scene]:
    """One frame, completed after what other frames and earlier fills show of it; and the scene, in which it has depth wherever it
    has a colour. clock: counts seconds by stage."""
    recipe = plan.recipe
    with clock("fill"):
        begin_stage(f"fill frame {scene.numbers[place]}")
        frame = scene.frames[place].load()
        context = plan.context.near(frame.camera)
        before = render_measured(plan.measured, scene, frame.camera, recipe.mode, recipe.footprint)
        known, moved = close_by_earlier_fill(context.law, scene, before, recipe.mode, frames=scene is not plan.measured)
        view, filled = inpaint(known, plan.inpainter, context, plan.seed)
        colored = frame.depth_hole
        if colored.any():
            shown = replace(view, color=frame.color)  # as it is in these pixels
            scene = replace_frame(scene, place, frame.with_pixels(shown, colored))
        larger = fuse(scene, view, before.hole & ~known.hole)
    return CompletedView(before, view, NO_DILATION, (FillReport(law_moves=moved), filled)), larger


def complete_view(
    plan: Plan, scene: Scene, camera: Camera, clock: StageClock = nullcontext
) -> tuple[CompletedView, Scene]:
    """The view of one camera, completed, and the scene with what was filled for it. clock: counts seconds by stage.

    Depth edges count for the fill where the scene's frames are drawn with them.
    """
    recipe = plan.recipe
    with clock("render"):
        context = plan.context.near(camera)
        law = context.law.with_aligned_edges(scene)
        before, given_up = render_measured(plan.measured, scene, camera, recipe.mode, recipe.footprint), 0
        if recipe.dilate_holes:
            before, given_up = dilate_holes(before, recipe.dilate_holes)
        redrawn = plan.measured.has_frame_of(camera) or recipe.dilate_holes > 0 or recipe.footprint
        frames = redrawn and scene is not plan.measured
        known, moved = close_by_earlier_fill(context.law, scene, before, recipe.mode, frames)
    with clock("fill"):
        view, filled = inpaint(known, plan.inpainter, replace(context, law=law), plan.seed)
    with clock("fuse"):
        larger = fuse(scene, view, before.hole & ~known.hole)
    grown = Dilation(int(before.hole.sum()) - given_up, given_up)
    return CompletedView(before, view, grown, (FillReport(law_moves=moved), filled)), larger


def as_completed(plan: Plan, scene: Scene, frame: CompletedView, camera: Camera) -> CompletedView | None:
    """The view of a camera of a scene whose one frame is completed: what the frame shows; None: it shows another one."""
    before, view = frame.before, frame.view
    if len(scene.frames) > 1 or plan.recipe.dilate_holes or view.hole.any() or not camera.same_view_as(view.camera):
        return None
    grown = Dilation(int(before.hole.sum()), 0)
    before, view = replace(before, camera=camera), replace(view, camera=camera)
    return CompletedView(before, view, grown, (FillReport(), FillReport()))


def complete_views(
    plan: Plan, scene: Scene, cameras: Sequence[Camera], clock: StageClock
) -> tuple[list[CompletedView], list[FillReport], Scene]:
    """The views of cameras, each of which sees what was filled before, first in the frames that matter for them; the reports of
    all that was filled, frames first; and the scene with it."""
    fills: list[FillReport] = []
    own: CompletedView | None = None  # the last frame, where a camera asks for just that and the scene still shows it
    for place in frames_to_fill(plan, scene, cameras):
        own, filled = complete_frame(plan, scene, place, clock)
        scene = filled
        fills += own.reports
        if plan.again and own.reports[1].hole_pixels:
            with clock("fill"):
                plan, scene, report = estimate_again(plan, scene, place, own.view)
            fills.append(report)
        if scene is not filled or not any(camera.same_view_as(own.view.camera) for camera in cameras):
            own = None  # the scene holds what was filled
    completed: list[CompletedView] = []
    filled = scene
    for camera in cameras:
        found = as_completed(plan, scene, own, camera) if own is not None and scene is filled else None
        if found is None:
            found, scene = complete_view(plan, scene, camera, clock)
        fills += found.reports
        completed.append(found)
    return completed, fills, scene
