"""A view with holes in; the same with them dilated, or closed by what was filled earlier or by another rendering, out."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.geometry.codes import LARGEST_CONFIDENCE, SEEN_AGAIN, HoleType, Origin, has_code
from dlama.geometry.drawing.layers import Mode
from dlama.geometry.holes import box_around, dilate_mask, fill_with_nearest
from dlama.geometry.rendering import render, render_fills
from dlama.geometry.rgbd import replace_pixels
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law


def dilate_holes(view: View, radius: int) -> tuple[View, int]:
    """The view with its holes dilated by `radius` px, and how many known pixels that gave up; each takes the type of the nearest
    hole pixel."""
    given_up = dilate_mask(view.hole, radius) & ~view.hole
    if not given_up.any():
        return view, 0
    larger = view.without(given_up, HoleType.DISOCCLUDED)
    types = np.where(given_up, fill_with_nearest(view.hole_type, view.hole), view.hole_type)
    return dataclasses.replace(larger, hole_type=types), int(given_up.sum())


def close_by_earlier_fill(law: Law, scene: Scene, view: View, mode: Mode, frames: bool) -> tuple[View, int]:
    """The view with its holes closed where `scene` was filled for a frame or for earlier cameras, and how many pixels the law
    moved. frames: whether frames may show something there, too, else `view` is how they are drawn."""
    if not view.hole.any() or not (scene.fills or frames):
        return view, 0
    if len(scene.frames) == 1 and all(layer.camera.same_view_as(view.camera) for layer in scene.layers):
        return close_in_place(law, scene, view, mode)
    return close_holes(law, view, render_fills(scene, view.camera, mode, view.hole, frames))


def close_in_place(law: Law, scene: Scene, view: View, mode: Mode) -> tuple[View, int]:
    """As `close_by_earlier_fill`, of a scene all of whose layers are of the view's own camera: the box of its holes is drawn
    alone."""
    rows, columns = box_around(view.hole, 0)
    part = view.cropped(rows, columns)
    frames, fills = (tuple(one.load().cropped(rows, columns) for one in of) for of in (scene.frames, scene.fills))
    earlier = render(Scene(frames, fills=fills), part.camera, mode, types=False, close=False)
    closed, moved = close_holes(law.cropped(view, rows, columns), part, earlier)
    return paste_part(view, closed, rows, columns), moved


def close_holes(law: Law, view: View, earlier: View, *, measured: bool = False) -> tuple[View, int]:
    """The holes of a view closed with another rendering of the same camera, where that knows more, and how many pixels the law
    moved.

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
    return known, int(moved.sum())


def paste_part(view: View, part: View, rows: slice, columns: slice) -> View:
    """The view with a part of it (`View.cropped`) in its place."""
    planes = {}
    for one in dataclasses.fields(View)[1:]:
        whole, inside = getattr(view, one.name), getattr(part, one.name)
        if inside is None or (whole is not None and np.array_equal(whole[rows, columns], inside)):
            continue
        shape = (*view.hole.shape, *inside.shape[2:])
        planes[one.name] = np.zeros(shape, inside.dtype) if whole is None else whole.copy()
        planes[one.name][rows, columns] = inside
    return view.with_planes(**planes)
