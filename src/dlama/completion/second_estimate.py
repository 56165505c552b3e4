"""A photo that was painted where an object was removed, its depth estimated, in; its depth there, and next to it, estimated once
more from the painted picture, out.

An estimate of depth blurs an object into what lies next to it, and a fill continues what it finds there: a low block, or a spike,
would stay where the object stood. The second estimate does not see the object. Inverse depth is fitted to the first one in a ring
farther out, where neither saw it.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from typing import Any, NamedTuple

import numpy as np

from dlama.completion.start import Plan
from dlama.errors import DepthError
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.frames.stored import Layer
from dlama.geometry.holes import Box, box_around, distance_to, smaller_size
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, paste
from dlama.geometry.scene import Scene, replace_frame
from dlama.geometry.view import View
from dlama.inpainters.filling import FillReport
from dlama.models.network_file import make_room
from dlama.perception.monocular import estimate_depth
from dlama.perception.resampling import interpolate, nearest_pixels, shrink_color
from dlama.perception.sharpening import sharpen_depth
from dlama.progress import begin_stage

SIDE, REACH_PX, RING_PX = 512, 24, 80
"""Distances from the removed object, in px of a picture whose longer side is the first: up to the next the second estimate
counts, in full on the inner half; up to the last the two are fitted."""
LARGEST = 2048
"""Longer side in px of the picture that is estimated: surfaces behind an object need no finer edges."""
FEWEST = 200
"""Pixels that two estimates are fitted in, at least."""
AGREES = 0.15
"""Median relative difference of inverse depth in the ring, up to which the second estimate is taken."""
LEAST = 1e-3
"""Inverse depth (1/m) below which a surface is not placed."""
ROUNDS, OUTLIER = 4, 2.5
"""Fits of a scale and a shift, each without what is off by so many median differences of the one before."""


class Fit(NamedTuple):
    """How the second estimate is brought to the first."""

    scale: float
    shift: float
    notes: dict[str, Any]
    """For meta.json: whether it is taken, else why not."""


def estimate_again(plan: Plan, scene: Scene, place: int, view: View) -> tuple[Plan, Scene, FillReport]:
    """The plan and the scene with the depth behind and next to what was removed from a frame estimated again, and what that did;
    unchanged where depth is not estimated, or the estimates do not agree round the object.

    view: the frame, filled. Far pixels, measured depth and all colours stay.
    """
    frame = scene.frames[place].load()
    removed = frame.object_hole
    if plan.recipe.depth_by != "surfaces" or Origin.ESTIMATED not in frame.origins or not removed.any():
        return plan, scene, FillReport()
    begin_stage("estimate depth again")
    again = estimate_inverse_depth(view.color, box_in_reach(removed))
    make_room(removed.size)
    fit = fit_round_object(frame, removed, again)
    if not fit.notes["taken"]:
        return plan, scene, FillReport(notes={"depth_estimated_again": fit.notes})
    plan, scene, moved = take_estimate(plan, scene, place, removed, view, again, fit)
    return plan, scene, FillReport(law_moves=moved, notes={"depth_estimated_again": fit.notes})


def take_estimate(
    plan: Plan, scene: Scene, place: int, removed: BoolArray, view: View, again: Float32Array, fit: Fit
) -> tuple[Plan, Scene, int]:
    """The plan and the scene with a second estimate (H x W inverse depth) taken in its frame at that place, in what was removed
    from it (H x W) and in its fills; and how many pixels the law moved. view: the frame, filled."""
    frame, measured = scene.frames[place].load(), plan.measured.frames[place]
    rows, columns = box = box_in_reach(removed)
    part = view.cropped(rows, columns)
    depth, changed = mix_depth(frame.cropped(rows, columns), part, again[box], fit, reach_of(removed))

    def of_camera(one: Layer) -> bool:
        return one.camera.same_view_as(view.camera)

    def background(one: View) -> View:  # round the mask; the object itself keeps its depth, behind which all is filled
        return with_depth(one, depth, changed & (one.hole_type[box] != HoleType.OBJECT.value), box)

    clean = with_depth(measured.load(), depth, changed, box)
    own = clean if scene.frames[place] is measured else with_depth(frame, depth, changed, box)
    removals = tuple(background(one.load()) if of_camera(one) else one for one in scene.removals)
    known = dataclasses.replace(replace_frame(plan.measured, place, clean), removals=removals)
    plan = dataclasses.replace(plan, measured=known)
    law = plan.context.near(view.camera).law.cropped(view, rows, columns)
    lawful, moved = law.project(part.camera, depth, changed & removed[box])
    fills = tuple(with_depth(one.load(), lawful, changed, box) if of_camera(one) else one for one in scene.fills)
    return plan, dataclasses.replace(replace_frame(scene, place, own), removals=removals, fills=fills), int(moved.sum())


def with_depth(one: View, depth: Float32Array, where: BoolArray, box: Box) -> View:
    """A layer with another depth in the known pixels of `where`; both are parts of it, in a box of rows and columns."""
    new = np.zeros(one.depth.shape, np.float32)  # of a fill the system gives no memory beyond its pixels
    paste(one.depth, ~one.hole, new)
    paste(depth, where & ~one.hole[box], new[box])
    return one.with_planes(depth=new)


def reach_of(removed: BoolArray) -> float:
    """Px from what was removed (H x W), up to which the second estimate counts."""
    return REACH_PX * max(removed.shape) / SIDE


def box_in_reach(removed: BoolArray) -> Box:
    """Rows and columns of the box in which the second estimate counts."""
    return box_around(removed, math.ceil(reach_of(removed)))


def estimate_inverse_depth(color: UInt8Array, box: Box) -> Float32Array:
    """H x W inverse depth of a picture (H x W x 3) by the network that ships, of a scale and shift of its own, with sharp edges
    in a box of rows and columns; 0 where that is far, everywhere if it sees nothing else."""
    where = np.zeros(color.shape[:2], np.bool_)
    where[box] = True
    size = smaller_size(color.shape, LARGEST)[::-1]
    small = shrink_color(color, size)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of scale and field of view, which count for nothing here
            found = inverse_depth(estimate_depth(small, sharpen=False).depth)
    except DepthError:
        found = np.zeros(size, np.float32)
    return interpolate(sharpen_depth(found, small, where=nearest_pixels(where, size)), color.shape)


def fit_round_object(frame: View, removed: BoolArray, again: Float32Array) -> Fit:
    """The fit of a second estimate (H x W inverse depth, of any scale and shift) to a frame's depth in the ring round what was
    removed (H x W)."""
    step = max(1, max(removed.shape) // SIDE)
    size = max(removed.shape) / SIDE / step
    few = np.s_[::step, ::step]
    distance = distance_to(removed[few])
    known = (frame.origin[few] == Origin.ESTIMATED.value) & ~frame.hole[few]
    w, again = inverse_depth(frame.depth[few]), again[few]
    ring = known & (w > 0) & (again > 0) & (distance > REACH_PX * size) & (distance <= RING_PX * size)
    if ring.sum() < FEWEST:
        return Fit(1, 0, {"taken": False, "reason": "too little is known round the object"})
    scale, shift = fit_scale_and_shift(again[ring], w[ring])
    off = float(np.median(np.abs((scale * again[ring] + shift) / w[ring] - 1)))
    taken = scale > 0 and off <= AGREES
    why = {} if taken else {"reason": "it differs round the object"}
    return Fit(scale, shift, {"taken": taken, "difference_round_it": round(off, 4)} | why)


def mix_depth(frame: View, view: View, again: Float32Array, fit: Fit, reach: float) -> tuple[Float32Array, BoolArray]:
    """Depth (H x W metres) of a part of a frame, and where it is new: behind its removed object and up to `reach` px next to it
    the second estimate (`again`, H x W inverse depth), from half of that on mixed with the depth of the filled `view`."""
    behind = frame.object_hole
    share = np.clip(2 - 2 * distance_to(behind) / reach, 0, 1)
    w = inverse_depth(view.depth)
    w += share * (fit.scale * again + fit.shift - w)
    known = frame.valid & (frame.origin == Origin.ESTIMATED.value)
    changed = (share > 0) & (behind | known) & view.valid & (again > 0) & (w > LEAST)
    return np.where(changed, 1 / np.maximum(w, LEAST), view.depth).astype(np.float32), changed


def fit_scale_and_shift(values: Float32Array, expected: Float32Array) -> tuple[float, float]:
    """The scale and shift that bring N values nearest to those expected (N), without outliers."""
    kept = np.ones(len(values), np.bool_)
    scale, shift = 1.0, 0.0
    for _ in range(ROUNDS):
        design = np.stack([values[kept], np.ones(int(kept.sum()))], 1)
        scale, shift = map(float, np.linalg.lstsq(design, expected[kept], rcond=None)[0])
        off = np.abs(scale * values + shift - expected)
        kept = off <= OUTLIER * np.median(off) + 1e-9
    return scale, shift
