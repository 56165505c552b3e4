"""The method for stereo: a rectified pair and its rig in; depth, both views completed alike, disparities out (paper: SII).

The left view is completed and rendered into the right one, and only what is still unknown there is filled, so both agree by
construction. The paper fills each view alone and matches afterwards: that is `recipe="paper"`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dlama.completion.pipeline import (
    Completion,
    Work,
    adopt,
    as_recipe,
    clipped,
    law_of,
    measured_as,
    report,
    start,
)
from dlama.completion.recipes import Recipe, find_recipe
from dlama.errors import InputError, ShapeError
from dlama.geometry.camera import StereoRig
from dlama.geometry.fusion import fuse
from dlama.geometry.holes import checked_mask, dilated
from dlama.geometry.projection import depth_from_disparity, disparity_from_depth
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, Origin, View
from dlama.inpainters import find_filler
from dlama.inpainters.filling import Inpainter
from dlama.inpainters.networks.pair import PairFiller
from dlama.perception.stereo_matching import StereoConsistency, carry_mask, consistency, disparity_pair

FAR_PX = 0.5
"""Disparity (with doffs) below which depth is no more than a guess: such pixels are far."""

EASED = 8
"""Pixels from which a removed object's nearest depth is taken, where the law asks how near it is."""

LENT = 0.85
"""Share of a removed object's disparity from which a pixel beside it counts as the object's."""


@dataclass(frozen=True, eq=False)
class StereoCompletion(Completion):
    """A completion whose two views are the left and the right of a pair."""

    disparity_left: Float32Array
    """H x W px of the completed left view, 0 = far."""
    disparity_right: Float32Array
    """H x W px of the completed right view, 0 = far."""
    agreement: StereoConsistency
    """How well the two completed views agree, over the whole picture."""


def stereo(
    left: UInt8Array,
    right: UInt8Array,
    rig: StereoRig,
    *,
    mask: BoolArray | None = None,
    mask_right: BoolArray | None = None,
    max_disparity: float | None = None,
    far: float | None = None,
    filler: str | Inpainter = "layered",
    model: str | Path | None = None,
    recipe: str | Recipe = "dlama",
    seed: int = 0,
    **changes: Any,
) -> StereoCompletion:
    """Depth from a rectified pair; with `mask` (left view, bool, True = remove) the object is taken out of both views.

    left, right: uint8 H x W x 3. Without a mask the right view is synthesised from the left. `mask_right` defaults to the left
    mask carried over by disparity. `far` (metres): what is measured at or beyond it counts as far (sky); by default what
    half a pixel of disparity cannot tell from infinity. Raises InputError and its kin.
    """
    far = rig.left.fx * rig.baseline_m / FAR_PX if far is None else far
    if not far > 0:
        raise InputError(f"far is {far} m; more than 0 is wanted")
    for name, picture in (("left", left), ("right", right)):
        if picture.shape[:2] != rig.left.hw:
            raise ShapeError(
                f"the {name} picture is {picture.shape[1]}x{picture.shape[0]} and the calibration "
                f"{rig.left.width}x{rig.left.height}; both must have the same size"
            )
    if mask is None and mask_right is not None:
        raise InputError("mask_right was given without mask; the mask of the left view is wanted too")
    chosen, fill = find_recipe(recipe, changes), find_filler(filler, model)
    pair = fill if isinstance(fill, PairFiller) else None
    if pair is not None and chosen.depth_by != "surfaces":
        raise InputError(
            f"depth_by is {chosen.depth_by!r} and the filler 'pair', which fills no depth; surfaces is wanted"
        )
    at_left, at_right = disparity_pair(left, right, max_disparity=max_disparity)
    if mask is not None:
        checked_mask(mask, rig.left.hw)
        mask_right = carry_mask(mask, at_left) if mask_right is None else checked_mask(mask_right, rig.right.hw)
    if mask is not None and mask_right is not None and not chosen.source_first:
        return apart(
            left,
            right,
            rig,
            dilated(mask, chosen.dilate),
            dilated(mask_right, chosen.dilate),
            chosen,
            filler,
            seed,
            far,
            fill,
        )
    source = rgbd_of(left, at_left, rig, far)
    if pair is not None:
        unknown = np.zeros(rig.right.hw, bool) if mask_right is None else dilated(mask_right, chosen.dilate)
        fill = pair.painter(right, unknown, left=True)
    eased = None
    if mask is not None and mask_right is not None:
        nearest = at_surest(at_left, mask)
        eased = rgbd_of(left, nearest, rig, far).depth
        source = rgbd_of(left, freed(at_left, nearest, mask, rig.doffs), rig, far)
        at_right = freed(at_right, at_surest(at_right, mask_right), mask_right, rig.doffs)
    work = start(View.from_rgbd(clipped(source, chosen.clip_m)), mask, fill, chosen, seed, eased)
    left_before, left_view = completed_left(work, source, rig)
    if mask_right is None:
        right_before = synthesised_right(work, rig)
    else:
        right_before = known_right(work, rgbd_of(right, at_right, rig, far, right=True), mask_right, eased)
    if pair is not None:
        seen = pair.painter(left_view.color, np.zeros(rig.left.hw, bool), left=False)
        work.inpainter = as_recipe(seen, chosen)
    right_view = completed_right(work, right_before, rig)
    return finished(work, source, (left_before, right_before), (left_view, right_view), rig, filler)


def rgbd_of(color: UInt8Array, disparity: Float32Array, rig: StereoRig, far: float, right: bool = False) -> RGBD:
    """One picture of the pair with the depth of its own disparity; at or beyond `far` metres it is far."""
    depth = depth_from_disparity(disparity, fx=rig.left.fx, baseline_m=rig.baseline_m, doffs=rig.doffs)
    depth = np.where(depth >= far, np.float32(np.inf), depth)
    return RGBD(color, depth, rig.right if right else rig.left)


def at_surest(disparity: Float32Array, mask: BoolArray) -> Float32Array:
    """H x W px: the largest disparity of the object (mask, H x W bool) within EASED px, everywhere; 0 where there is none.

    What is hidden lies behind the object; how far behind, a matched object's own noise must not decide.
    """
    import cv2

    there = np.where(mask, disparity, np.float32(0))
    return np.asarray(cv2.dilate(there, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * EASED + 1,) * 2)))


def freed(disparity: Float32Array, nearest: Float32Array, mask: BoolArray, doffs: float) -> Float32Array:
    """Disparity without what the object (mask) lent to its surroundings: 0 within EASED px of it where it is as near.

    nearest: as `at_surest` gives it. Matching lets a nearer thing bleed over its edge; ground on which the object stands is
    taken for it too, and comes back with the surface it belongs to.
    """
    as_near = disparity + doffs >= np.float32(LENT) * (nearest + np.float32(doffs))
    return np.where(~mask & as_near & (nearest > 0), np.float32(0), disparity)


def completed_left(work: Work, source: RGBD, rig: StereoRig) -> tuple[View, View]:
    """The left view before filling (sensor holes and the object open) and after, from the scene that `start` made."""
    base = work.scene.layers[0]
    before = View.from_rgbd(source)
    if base.hole.any():
        before = before.without(base.hole & (base.hole_type == HoleType.OBJECT), HoleType.OBJECT)
    view = render(work.scene, rig.left, work.recipe.mode)
    hole = before.hole_type > 0
    filled = work.fill(view) if view.hole.any() else view
    return before, dataclasses.replace(filled, hole_type=np.where(hole, before.hole_type, filled.hole_type))


def synthesised_right(work: Work, rig: StereoRig) -> View:
    """The right view as the left one's scene shows it."""
    with work.stage("render"):
        return render(work.scene, rig.right, work.recipe.mode)


def known_right(work: Work, frame: RGBD, mask: BoolArray, law_depth: Float32Array | None) -> View:
    """The right picture with the object open; from now on what it measured counts for the law too. law_depth: as `start`."""
    before = View.from_rgbd(frame).without(dilated(mask, work.recipe.dilate), HoleType.OBJECT)
    scene = Scene((*work.scene.layers, before), work.scene.objects)
    work.law = law_of(scene if law_depth is None else measured_as(scene, law_depth), work.recipe)
    return before


def completed_right(work: Work, before: View, rig: StereoRig) -> View:
    """The right view: first what the completed left scene shows in its holes, then what is still unknown, filled."""
    with work.stage("render"):
        shown = render(work.scene, rig.right, work.recipe.mode, types=False)
    depth_only = before.hole & ~before.color_hole
    view = adopt(
        work, before, dataclasses.replace(shown, color=np.where(depth_only[..., None], before.color, shown.color))
    )
    view = dataclasses.replace(view, origin=np.where(depth_only, np.uint8(Origin.DEPTH_FILLED), view.origin))
    filled = work.fill(view)
    with work.stage("fuse"):
        # the right picture's own pixels stay out of the left one's scene
        adopted = (before.hole & ~view.hole) | (filled.origin == Origin.DEPTH_FILLED)
        work.scene = fuse(work.scene, filled.without(adopted, HoleType.NONE))
    return filled


def finished(
    work: Work,
    source: RGBD,
    before: tuple[View, View],
    views: tuple[View, View],
    rig: StereoRig,
    filler: str | Inpainter,
) -> StereoCompletion:
    """Disparities, their agreement, and the meta data."""
    lens = {"fx": rig.left.fx, "baseline_m": rig.baseline_m, "doffs": rig.doffs}
    at_left, at_right = (disparity_from_depth(view.depth, **lens) for view in views)
    agreement = consistency(views[0].color, views[1].color, at_left, at_right)
    given = View.from_rgbd(source)
    meta = report(work, given, before, filler)
    meta["stereo"] = {**lens, "consistency": dataclasses.asdict(agreement)}
    return StereoCompletion(views, before, work.scene, given, meta, at_left, at_right, agreement)


def apart(
    left: UInt8Array,
    right: UInt8Array,
    rig: StereoRig,
    taken: BoolArray,
    taken_right: BoolArray,
    chosen: Recipe,
    filler: str | Inpainter,
    seed: int,
    far: float,
    fill: Inpainter,
) -> StereoCompletion:
    """The paper's way: colour of each view filled alone, then matched; depth is what the matching finds."""
    flat = [
        RGBD(color, np.ones(color.shape[:2], np.float32), camera)
        for color, camera in ((left, rig.left), (right, rig.right))
    ]
    works = [start(View.from_rgbd(one), None, fill, chosen, seed) for one in flat]
    holes = [View.from_rgbd(one).without(where, HoleType.OBJECT) for one, where in zip(flat, (taken, taken_right))]
    colors = [work.fill(view) for work, view in zip(works, holes)]
    matched = disparity_pair(colors[0].color, colors[1].color)
    views = []
    for view, disparity, is_right in zip(colors, matched, (False, True)):
        found = View.from_rgbd(clipped(rgbd_of(view.color, disparity, rig, far, is_right), chosen.clip_m))
        views.append(marked(found, view))
    works[0].reports += works[1].reports
    works[0].scene = Scene((views[0],))
    return finished(
        works[0], rgbd_of(left, matched[0], rig, far), (holes[0], holes[1]), (views[0], views[1]), rig, filler
    )


def marked(found: View, filled: View) -> View:
    """A matched view with the provenance of its filled colours."""
    return dataclasses.replace(
        found,
        origin=np.where(filled.filled, np.uint8(Origin.FILLED), found.origin),
        hole_type=np.where(filled.hole_type > 0, filled.hole_type, found.hole_type),
    )
