"""The steps of the method, each a function from values to new values: `pipeline` and `stereo` put them in order.

take out (eq. 11) -> fill the source -> warp, mask (eq. 2-4) -> earlier fill -> fill (sec. 3.3) -> fuse (eq. 10)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from dlama.completion.recipes import Recipe
from dlama.errors import MaskError
from dlama.geometry.camera import Camera
from dlama.geometry.drawing.picture_edges import taken_by_camera
from dlama.geometry.fusion import fuse
from dlama.geometry.holes import checked_mask, dilated, grown
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, Origin, View
from dlama.geometry.visibility import Law, lawful_depth
from dlama.inpainters.confidence import SUREST
from dlama.inpainters.filling import FillReport, Inpainter, inpaint
from dlama.inpainters.grey_depth import with_grey_depth
from dlama.inpainters.layered.depth_first import depth_first

NOTHING_FILLED = FillReport(0, 0, 0, {})
SEEN_AGAIN = (Origin.REPROJECTED, Origin.ESTIMATED)
"""Origins of what the source view shows, seen from elsewhere."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What stays the same while one scene is completed."""

    recipe: Recipe
    inpainter: Inpainter
    """The filler, with the recipe's way of filling depth (`filler_of_recipe`)."""
    seed: int
    given: Scene
    """The scene as measured, without the removed object; nothing is filled."""
    law: Law
    """What the measurements forbid filled depth to hide."""


class Dilation(NamedTuple):
    """What growing a mask or a hole cost."""

    pixels: int
    """Pixels of the mask or the hole before it grew."""
    known_pixels_given_up: int
    """Known pixels that it grew over."""


NO_DILATION = Dilation(0, 0)
HALO_PX = 3
"""Pixels beside its outline that hold some of a thing's colours in a depth camera's compressed, sharpened, blurred picture."""


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


def filler_of_recipe(filler: Inpainter, recipe: Recipe) -> Inpainter:
    """The filler with the recipe's way of filling depth: by surfaces, in 8-bit steps, or its own."""
    if recipe.depth_by == "surfaces":
        return depth_first(filler)
    return with_grey_depth(filler, recipe.clip) if recipe.eight_bit_depth and recipe.clip is not None else filler


def halo(source: View) -> int:
    """px beyond its outline to which a thing's colours are spread in a picture: HALO_PX where a depth camera took it, else 0.

    Its pictures are compressed, sharpened and blurred; a rim of such colours stays where a thing is taken out tightly.
    """
    return HALO_PX if taken_by_camera(source) else 0


def take_out(source: View, mask: BoolArray | None, radius: int) -> tuple[Scene, Dilation]:
    """The scene of one view without the object under `mask` (H x W bool) grown by `radius` px. Raises MaskError."""
    if mask is None:
        return Scene((source,)), NO_DILATION
    larger = dilated(checked_mask(mask, source.camera.hw), radius)
    if larger.all():
        raise MaskError(f"dilate is {radius} px: the mask grown by that is full and leaves nothing to fill from")
    removed = source.without(~larger, HoleType.NONE)
    scene = Scene((source.without(larger, HoleType.OBJECT),), (removed,))
    return scene, Dilation(int(mask.sum()), int(larger.sum()) - int(mask.sum()))


def law_of(scene: Scene, recipe: Recipe, object_depth: Float32Array | None = None) -> Law:
    """What the measurements of a scene forbid; nothing, where the recipe knows no law.

    object_depth: H x W metres that count as measured at the removed object's pixels; None: its own.
    """
    if not recipe.law:
        return Law(())
    if object_depth is None:
        return Law.of(scene)
    objects = (dataclasses.replace(one, depth=np.where(one.hole, one.depth, object_depth)) for one in scene.objects)
    return Law.of(dataclasses.replace(scene, objects=tuple(objects)))


def fill(plan: Plan, view: View) -> tuple[View, FillReport]:
    """The view with all its holes filled under the plan's law, and what that did."""
    return inpaint(view, plan.inpainter, plan.law, plan.seed)


def fill_source(plan: Plan) -> tuple[Scene, tuple[FillReport, ...]]:
    """The given scene with its sensor holes and the object's background filled in the source view, if the recipe says so."""
    source = plan.given.layers[0]
    if not (plan.recipe.source_first and source.hole.any()):
        return plan.given, ()
    filled, report = fill(plan, source)
    measured = filled.without(filled.filled, HoleType.OBJECT)
    return fuse(dataclasses.replace(plan.given, layers=(measured,)), filled), (report,)


def warp(plan: Plan, scene: Scene, camera: Camera) -> tuple[View, Dilation]:
    """What the measurements alone show from `camera`: I', lambda' and M (eq. 2-4), the hole grown as the recipe says.

    Away from the source cameras the depth of sensor holes, filled there (in `scene`), counts as measured.
    """
    home = any(camera.same_view_as(one.camera) for one in plan.given.measured)
    base, mode = plan.given if home else scene, plan.recipe.mode
    view = render(dataclasses.replace(base, layers=base.measured, objects=plan.given.objects), camera, mode)
    if plan.recipe.footprint and plan.given.objects:
        object_seen = render(Scene(plan.given.objects), camera, mode, types=False)
        view = view.without(~object_seen.hole & ~view.hole, HoleType.OBJECT)
    larger = grown(view, plan.recipe.dilate_holes)
    return larger, Dilation(int(view.hole.sum()), int((larger.hole & ~view.hole).sum()))


def show_earlier_fill(plan: Plan, scene: Scene, before: View) -> tuple[View, FillReport]:
    """The view with its holes closed where `scene` was filled for the source or for earlier cameras, and what that did."""
    if scene is plan.given or not before.hole.any():
        return before, NOTHING_FILLED
    return close_holes(plan.law, before, render(scene, before.camera, plan.recipe.mode, types=False, close=False))


def close_holes(law: Law, view: View, earlier: View, *, measured: bool = False) -> tuple[View, FillReport]:
    """The holes of a view closed with another rendering of the same camera, where that knows more, and what that did.

    Colours that were measured stay. Surfaces are drawn between lawful pixel centres, so the depth that is taken over is
    projected onto the law once more. measured: what `earlier` shows of measurements stays marked as such (REPROJECTED).
    """
    closed = view.hole & ~earlier.hole
    depth, moved = lawful_depth(view, np.where(closed, earlier.depth, view.depth), closed, law)
    of_color = closed & view.color_hole
    again = np.isin(earlier.origin, SEEN_AGAIN) & (not measured)
    origin = np.where(again, np.uint8(Origin.FILLED), earlier.origin)
    known = view.with_planes(
        color=np.where(of_color[..., None], earlier.color, view.color),
        depth=depth,
        hole=view.hole & ~closed,
        origin=np.where(of_color, origin, view.origin),
        confidence=np.where(closed, np.where(again, np.float32(SUREST), earlier.confidence), view.confidence),
        errors=with_errors_of(view, earlier, closed),
    )
    if view.frame is not None and earlier.frame is not None:
        known = known.with_planes(frame=np.where(of_color, earlier.frame, view.frame))
    return known, FillReport(0, moved, 0, {})


def with_errors_of(view: View, other: View, where: BoolArray) -> Float32Array | None:
    """The expected errors of a view, in the pixels of `where` (H x W bool) those of another one of the same camera."""
    if other.errors is None:
        return view.errors
    own = np.zeros_like(other.errors) if view.errors is None else view.errors
    return np.where(where[..., None], other.errors, own)


def fuse_new(scene: Scene, before: View, known: View, filled: View) -> Scene:
    """The scene with what was filled anew; holes of `before` that `known` had closed already come from the scene itself."""
    return fuse(scene, filled, before.hole & ~known.hole)


def complete_view(
    plan: Plan, scene: Scene, camera: Camera, clock: Callable[[str], AbstractContextManager[Any]] = nullcontext
) -> tuple[CompletedView, Scene]:
    """The view of one camera, completed, and the scene with what was filled for it. clock: counts seconds by stage."""
    with clock("render"):
        before, grown_hole = warp(plan, scene, camera)
        known, taken_over = show_earlier_fill(plan, scene, before)
    with clock("fill"):
        placed = dataclasses.replace(plan, law=plan.law.near(camera).with_placed_edges(scene))
        view, filled = fill(placed, known)
    with clock("fuse"):
        larger = fuse_new(scene, before, known, view)
    return CompletedView(before, view, grown_hole, (taken_over, filled)), larger
