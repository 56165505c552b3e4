"""A photo that was painted where an object was removed, its depth estimated, in; its depth there, and next to it, estimated once
more from the painted picture, out.

An estimate of depth blurs an object into what lies next to it, and a fill continues what it finds there: a low block, or a spike,
would stay where the object stood. The second estimate does not see the object. Inverse depth is fitted to the first one in a ring
farther out, where neither saw it.
"""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any, NamedTuple

import cv2
import numpy as np

from dlama.completion.start import Plan
from dlama.errors import DepthError
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import project_depth
from dlama.inpainters.filling import FillReport
from dlama.perception.monocular import DEFAULT, estimate_depth
from dlama.progress import begin_stage

REACH_PX, RING_PX = 24, 80
"""Distances from the removed object, in px of a picture whose longer side is 512: up to the first the second estimate counts, in
full on the inner half; up to the second the two are fitted."""
FEWEST = 200
"""Pixels that two estimates are fitted in, at least."""
AGREES = 0.1
"""Median relative difference of inverse depth in the ring, up to which the second estimate is taken."""
LEAST = 1e-3
"""Inverse depth (1/m) below which a surface is not placed."""
ROUNDS, OUTLIER = 4, 2.5
"""Fits of a scale and a shift, each without what is off by so many median differences of the one before."""


class SecondEstimate(NamedTuple):
    """Depth of a frame after its second estimate."""

    depth: Float32Array
    """H x W metres."""
    changed: BoolArray
    """H x W, True where it is new."""
    notes: dict[str, Any]
    """For meta.json."""


def is_of_default_network(rgbd: object) -> bool:
    """Whether a picture's depth may be estimated again: by the network that ships, if that estimated it (of a scene it is not
    known). A better network, or a phone, is not corrected by it."""
    estimate = rgbd.estimate if isinstance(rgbd, RGBD) else None
    return estimate is None or estimate.get("estimator") == DEFAULT


def estimate_again(plan: Plan, scene: Scene, place: int, view: View) -> tuple[Plan, Scene, FillReport]:
    """The plan and the scene with the depth behind and next to what was removed from a frame estimated again, and what that did;
    unchanged where depth is not estimated, or the estimates do not agree round the object.

    view: the frame, filled. Far pixels, measured depth and all colours stay.
    """
    frame = scene.frames[place].load()
    removed = frame.hole & (frame.hole_type == HoleType.OBJECT.value)
    if plan.recipe.depth_by != "surfaces" or Origin.ESTIMATED not in frame.origins or not removed.any():
        return plan, scene, FillReport(0, 0, 0, {})
    begin_stage("estimate depth again")
    found = second_estimate(frame, removed, view)
    depth, moved = project_depth(view, found.depth, found.changed & removed, plan.context.near(view.camera).law)

    def renew(one: View) -> View:
        return one.with_planes(depth=np.where(found.changed & ~one.hole, depth, one.depth))

    def renew_frame(of: Scene) -> Scene:
        frames = (*of.frames[:place], renew(of.frames[place].load()), *of.frames[place + 1 :])
        return dataclasses.replace(of, frames=frames)

    if found.changed.any():
        fills = (renew(one.load()) if one.camera.same_view_as(view.camera) else one for one in scene.fills)
        scene = dataclasses.replace(renew_frame(scene), fills=tuple(fills))
        plan = dataclasses.replace(plan, measured=renew_frame(plan.measured))
    return plan, scene, FillReport(0, moved, 0, {"depth_estimated_again": found.notes})


def second_estimate(frame: View, removed: BoolArray, view: View) -> SecondEstimate:
    """The depth of a frame without an object (H x W `removed`), by an estimate from its filled `view`."""
    size = max(removed.shape) / 512
    reach = REACH_PX * size
    distance = cv2.distanceTransform((~removed).view(np.uint8), cv2.DIST_L2, 5)
    known = frame.valid & (frame.origin == Origin.ESTIMATED.value)
    ring = known & (distance > reach) & (distance <= RING_PX * size)
    unchanged = np.zeros_like(removed)
    if ring.sum() < FEWEST:
        return SecondEstimate(view.depth, unchanged, {"taken": False, "reason": "too little is known round the object"})
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of scale and field of view, which count for nothing here
            again = inverse_depth(estimate_depth(view.color, view.camera).depth)
    except DepthError as error:
        return SecondEstimate(view.depth, unchanged, {"taken": False, "reason": str(error)})
    w = inverse_depth(view.depth)
    scale, shift = fit_scale_and_shift(again[ring], w[ring])
    fitted = scale * again + shift
    off = float(np.median(np.abs(fitted[ring] / w[ring] - 1)))
    notes = {"difference_round_it": round(off, 4)}
    if scale <= 0 or off > AGREES:
        return SecondEstimate(view.depth, unchanged, {"taken": False, "reason": "it differs round the object"} | notes)
    share = np.clip(2 - 2 * distance / reach, 0, 1)
    w += share * (fitted - w)
    changed = (share > 0) & (removed | known) & view.valid & (again > 0) & (w > LEAST)
    depth = np.where(changed, 1 / np.maximum(w, LEAST), view.depth).astype(np.float32)
    return SecondEstimate(depth, changed, {"taken": True, "pixels": int(changed.sum())} | notes)


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
