"""Depth first: a Painter in; a filler that continues surfaces into the holes, then lets the Painter paint them, out."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.holes import dilate_mask, morphological_open, nearest_known, regions_touching, repeat_cells, square
from dlama.geometry.kernels.jit import begin_job
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, sampled_pixels
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Inpainter, Painter, part_worth_cropping
from dlama.inpainters.layered.color.low_frequency import blend_with_low_frequency, smooth_guess
from dlama.inpainters.layered.color.surface_colors import find_leaves, paint_leaves
from dlama.inpainters.layered.depth.surfaces import Surfaces, continue_lawfully
from dlama.inpainters.layered.remaining_shadows import depth_of_removed, find_remaining_shadow
from dlama.perception.planes import plane_values_at

BAND = 24
"""Pixels round a hole in which an occluder is hidden from the painter."""
OCCLUDERS_SIDE = 640
"""Longer side in pixels of a view in which occluders are found for a coarse picture."""
OCCLUDER_REACH = 0.25
"""Distance from the hole, over the picture's longer side, in which the rest of that occluder is hidden, too: a network that
sees the stripes of a barrel continues them into the hole next to it."""
MIXED_PX = 3
"""Pixels round an occluder that may be mixed with its colour."""
STEP = 1.1
"""Ratio of neighbouring depths at which the occluder ends."""
NEARER = 0.9
"""A known pixel nearer than this share of the depth filled next to it is an occluder."""

Painted = tuple[UInt8Array, dict[str, Any]]
"""H x W x 3 colours, and notes of what ran, for meta.json."""


def paint_over_depth(inpainter: Inpainter) -> Inpainter:
    """A filler that continues depth as `layered` does and lets the given Painter paint; any other filler is returned unchanged.

    A network's own depth out of view was compared and mixed with it: it is right more often at +-60 degrees and wrong more
    often before. Colours there are blended with a low-frequency estimate, as those of `layered` are.
    """

    if not isinstance(inpainter, Painter):
        return inpainter

    def fill(view: View, context: FillContext, seed: int) -> Fill:
        surfaces, depth, moved = continue_lawfully(view, context, seed)
        notes = inpainter.notes() | {"depth_as": "surfaces continued", "planes": len(surfaces.planes)}
        color, more = paint_in_part(view, surfaces, depth, context, partial(paint_behind, seed=seed, painter=inpainter))
        return Fill(color, depth, moved, notes | more)

    return fill


def paint_behind(
    view: View, surfaces: Surfaces, depth: Float32Array, context: FillContext, seed: int, painter: Painter
) -> Painted:
    """The colours of a view whose depth (H x W metres) is filled, by a painter that sees no occluders."""
    hidden, notes = hide_from_painter(view, surfaces, depth, context.law)
    leaves = find_leaves(view, surfaces)
    guess = begin_job(smooth_guess, view)
    color = painter.fill_picture(view.color, hidden, seed)
    w = inverse_depth(np.where(view.hole, depth, view.depth))
    color = blend_with_low_frequency(view, color, view.color_hole, w, guess=guess)
    return paint_leaves(color, view, leaves), notes


def paint_in_part(
    view: View, surfaces: Surfaces, depth: Float32Array, context: FillContext, paint: Callable[..., Painted]
) -> Painted:
    """What `paint(view, surfaces, depth, context)` makes of the part of a view round its colour holes, in the whole picture.

    Depth may be missing all over it, as in a depth camera's: painting is proportional to the hole all the same.
    """
    hole = view.color_hole
    if not hole.any():
        return view.color, {}
    box = None if surfaces.leaves.size else part_worth_cropping(hole)
    if box is None:
        return paint(view, surfaces, depth, context)
    rows, columns = box
    part = view.cropped(rows, columns), surfaces.cropped(rows, columns), depth[box]
    color = view.color.copy()
    color[box], notes = paint(*part, context.cropped(view, rows, columns))
    return color, notes


def hide_from_painter(
    view: View, surfaces: Surfaces, depth: Float32Array, law: Law, coarsely: bool = False
) -> tuple[BoolArray, dict[str, Any]]:
    """H x W, True in what a painter must not see: the colour holes, occluders next to them, the remaining shadow of a removed
    object; and how many pixels of shadow remain, for the notes of a Fill.

    surfaces: as continued; depth: H x W metres, filled; coarsely: for a painter that sees no finer picture.
    """
    find, missing = find_occluders_coarsely if coarsely else find_occluders, view.depth_hole
    if missing.any():  # an occluder hides with all its pixels
        view = view.with_known_depth(depth, missing)
    hidden = view.color_hole | find(view, surfaces, depth, law)
    if not view.object_hole.any():
        return hidden, {}
    shadow = find_remaining_shadow(view, surfaces.label, law)
    return hidden | shadow, {"remaining_shadow_px": int(shadow.sum())}


def find_occluders(view: View, surfaces: Surfaces, depth: Float32Array, law: Law) -> BoolArray:
    """H x W, True in known pixels near a hole that are nearer than the surface filled into it: occluders, hidden from the
    painter.

    surfaces: as continued; depth: H x W metres, filled. First the adjacent pixels, then the rest of their object. Pixels next to
    a removed object or behind it are its background, never occluders.
    """
    hidden = asking = view.color_hole & (view.hole_type != HoleType.OUT_OF_VIEW.value)
    if (view.origin[view.valid] == Origin.ESTIMATED.value).all():
        asking = hidden & (view.hole_type != HoleType.OBJECT.value)
    if not asking.any():  # `is_in_front` takes no other hole
        return asking
    distance, nearest = nearest_known(view.color_hole & ~seams(surfaces.label, view.color_hole))
    near = (distance <= BAND) & view.valid
    adjacent = is_in_front(view, surfaces, depth, near, nearest)
    if not adjacent.any():
        return adjacent
    background = np.zeros_like(adjacent)
    if view.object_hole.any() and (removed := depth_of_removed(view, law)) is not None:
        behind = view.far | (view.valid & (view.depth > 0.95 * removed))  # or next to it
        background = (view.hole_type.ravel()[nearest] == HoleType.OBJECT.value) & behind
        adjacent &= ~background
    guessed = (view.origin == Origin.ESTIMATED.value).any()  # estimated depth has no reliable edges
    if guessed or not adjacent.any():
        return adjacent
    filled, there, before = (
        np.bincount(surfaces.label[of].clip(0), minlength=len(surfaces.planes) + 1) for of in (hidden, near, adjacent)
    )
    # a surface that continues in what was hidden is no occluder, unless most of its pixels are in front of the hole
    least = np.where(2 * before < there, 0.02, 0.5)[1:]
    continuing = 1 + np.flatnonzero(filled[1:] > least * hidden.sum())
    w = inverse_depth(np.where(view.hole, np.float32(np.inf), view.depth))
    edge = cv2.dilate(w, np.ones((3, 3), np.uint8)) > STEP * w
    candidates = view.valid & ~edge & ~np.isin(surfaces.label, continuing) & (distance <= OCCLUDER_REACH * max(w.shape))
    candidates &= w > inverse_depth(depth).ravel()[nearest]
    return (
        adjacent | (dilate_mask(regions_touching(candidates & ~background, adjacent), MIXED_PX) & view.valid)
    ) & ~background


def find_occluders_coarsely(view: View, surfaces: Surfaces, depth: Float32Array, law: Law) -> BoolArray:
    """H x W, as of `find_occluders`, of a view without a removed object: found in every n-th pixel, OCCLUDERS_SIDE at most
    a side, for a painter that sees no finer picture."""
    step = -(-max(view.hole.shape) // OCCLUDERS_SIDE)
    at = sampled_pixels(view.hole.shape, step)
    if step == 1 or not view.color_hole[at].any():
        return find_occluders(view, surfaces, depth, law)
    a, b, c = surfaces.planes.T  # in the sampled pixels' columns and rows, whose centres lie at 0.5
    aside = step // 2 + 0.5 - 0.5 * step
    planes = np.stack([step * a, step * b, c + aside * (a + b)], 1)
    coarse = Surfaces(surfaces.inverse_depth[at], surfaces.label[at], planes)
    found = find_occluders(view.subsample(step), coarse, depth[at], law)
    return repeat_cells(found, step, view.hole.shape) & view.valid


def seams(label: NDArray[np.int8], hole: BoolArray) -> BoolArray:
    """H x W, True where a plane fills a strip at most 12 px wide in a wider hole: the rim of an occluder that the coarse grid
    drew too large. label, hole: H x W."""
    kernel = square(13)
    out = np.zeros(hole.shape, np.bool_)
    for number in np.unique(label[hole & (label > 0)]):
        part = hole & (label == number)
        out |= part & ~morphological_open(part, kernel)
    return out & morphological_open(hole, kernel)


def is_in_front(
    view: View, surfaces: Surfaces, depth: Float32Array, where: BoolArray, nearest: NDArray[np.intp]
) -> BoolArray:
    """H x W, True in known pixels of `where` (H x W) in front of the surface at the hole pixel `nearest` (H x W, flat).

    The surface is extrapolated to the known pixel: ground that comes towards the camera hides nothing. Excluded are the
    picture's old border, beyond which nothing was hidden; holes in depth alone, whose colours are known; and removed objects in
    estimated depth, whose errors exceed the distances, so that nothing would be left to fill the hole with.
    """
    rows, columns = np.nonzero(where)
    hole_pixel = nearest[rows, columns]
    filled = inverse_depth(depth).ravel()[hole_pixel]
    labels = surfaces.label.ravel()[hole_pixel]
    continued = plane_values_at(surfaces.planes, labels, rows, columns)
    before = NEARER / view.depth[rows, columns] > np.maximum(continued, filled)
    why = view.hole_type.ravel()[hole_pixel]
    before &= why != HoleType.OUT_OF_VIEW.value
    before &= (why != HoleType.OBJECT.value) | (view.origin[rows, columns] != Origin.ESTIMATED.value)
    out = np.zeros(view.hole.shape, np.bool_)
    out[rows, columns] = before
    return out
