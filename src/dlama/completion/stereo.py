"""A rectified pair and its rig in; depth, both views completed alike, disparities out (paper: SII).

match -> left view: take out, fill -> right view: render the left one's scene, fill the rest -> fuse

Both views agree by construction. The paper fills each view alone and matches afterwards: that is `recipe="paper"`.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from dlama.completion.completion import StereoCompletion
from dlama.completion.pair import CompletedPair, MatchedPair, check_pair, default_far, masks_of_pair
from dlama.completion.published import clipped, complete_pair_one_by_one
from dlama.completion.recipes import DepthBy, Recipe, find_recipe
from dlama.completion.report import Clock, Record
from dlama.completion.steps import (
    Plan,
    close_holes,
    fill,
    fill_source,
    filler_of_recipe,
    fuse_new,
    law_of,
    take_out,
)
from dlama.errors import InputError
from dlama.geometry.camera import StereoRig
from dlama.geometry.holes import dilated
from dlama.geometry.rendering import Mode, render
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, Origin, View
from dlama.inpainters import find_filler
from dlama.inpainters.filling import Inpainter
from dlama.inpainters.networks.pair import PairFiller
from dlama.perception.stereo_matching import disparity_pair


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
    mode: Mode | None = None,
    dilate: int | None = None,
    dilate_holes: int | None = None,
    clip: float | None = None,
    depth_by: DepthBy | None = None,
    seed: int = 0,
) -> StereoCompletion:
    """Depth from a rectified pair; with `mask` the object is taken out of both views, else the right one is synthesised.

    Args:
        left: uint8 H x W x 3, RGB.
        right: uint8 H x W x 3, RGB.
        rig: The two cameras.
        mask: H x W bool of the left view, True = remove.
        mask_right: H x W bool of the right view; default: the left mask carried over by disparity.
        max_disparity: px, the largest disparity looked for; default: found.
        far: metres; what is measured at or beyond it is far (sky); default: what half a pixel of disparity cannot tell
            from infinity.
        filler, model, recipe, mode, dilate, dilate_holes, clip, depth_by, seed: As in `complete`.

    Raises:
        InputError: options that contradict each other, pictures of another size than the rig's (ShapeError), a mask that
            cannot be used (MaskError).
    """
    far = default_far(rig) if far is None else far
    check_pair(left, right, rig, far)
    if mask is None and mask_right is not None:
        raise InputError("mask_right was given without mask; the mask of the left view is wanted too")
    chosen = find_recipe(recipe, mode=mode, dilate=dilate, dilate_holes=dilate_holes, clip=clip, depth_by=depth_by)
    inpainter = find_filler(filler, model)
    if isinstance(inpainter, PairFiller) and chosen.depth_by != "surfaces":
        raise InputError(
            f"depth_by is {chosen.depth_by!r} and the filler 'pair', which fills no depth; surfaces is wanted"
        )
    disparities = disparity_pair(left, right, max_disparity=max_disparity)
    masks = masks_of_pair(mask, mask_right, disparities[0], rig)
    pair = MatchedPair(rig, far, (left, right), disparities, masks)
    one_by_one = masks is not None and not chosen.source_first
    complete_pair = complete_pair_one_by_one if one_by_one else complete_pair_together
    return complete_pair(pair, chosen, inpainter, seed, Clock()).as_completion(rig, filler)


def complete_pair_together(
    pair: MatchedPair, recipe: Recipe, filler: Inpainter, seed: int, clock: Clock
) -> CompletedPair:
    """The left view completed; the right one from the left one's scene, and only what is unknown there still filled."""
    clean = pair.without_bleeding()
    source, object_depth = clean.left, pair.object_depth
    given, grown_mask = take_out(
        View.from_rgbd(clipped(source, recipe.clip)), pair.masks and pair.masks[0], recipe.dilate
    )
    plan = Plan(recipe, left_filler(filler, pair, recipe), seed, given, law_of(given, recipe, object_depth))
    with clock("fill"):
        scene, source_fills = fill_source(plan)
        left, left_fill = fill(plan, render(scene, pair.rig.left, recipe.mode))
    left_before = left_before_filling(source, scene)
    left = dataclasses.replace(
        left, hole_type=np.where(left_before.hole_type > 0, left_before.hole_type, left.hole_type)
    )

    with clock("render"):
        right_before = right_before_filling(clean, scene, recipe)
        shown = render(scene, pair.rig.right, recipe.mode, types=False)
    if pair.masks is not None:  # what the right picture measured counts for the law too
        both = Scene((*scene.layers, right_before), scene.objects)
        plan = dataclasses.replace(plan, law=law_of(both, recipe, object_depth))
    plan = dataclasses.replace(plan, inpainter=right_filler(filler, left, recipe))
    known, taken_over = close_holes(plan.law, right_before, shown)
    with clock("fill"):
        right, right_fill = fill(plan, known)
    with clock("fuse"):
        own_depth = right.origin == Origin.DEPTH_FILLED  # the right picture's pixels stay out of the left one's scene
        scene = fuse_new(scene, right_before, known, right.without(own_depth, HoleType.NONE))
    record = Record([*source_fills, left_fill, taken_over, right_fill], clock.seconds, grown_mask)
    return CompletedPair(plan, source, (left_before, right_before), (left, right), scene, record)


def left_before_filling(source: RGBD, scene: Scene) -> View:
    """The left view with its sensor holes open, and the object where `scene` has one removed."""
    before, base = View.from_rgbd(source), scene.layers[0]
    removed = base.hole & (base.hole_type == HoleType.OBJECT)
    return before.without(removed, HoleType.OBJECT) if removed.any() else before


def right_before_filling(pair: MatchedPair, scene: Scene, recipe: Recipe) -> View:
    """The right picture with the object open; without masks, the right view as the left one's scene shows it."""
    if pair.masks is None:
        return render(scene, pair.rig.right, recipe.mode)
    return View.from_rgbd(pair.right).without(dilated(pair.masks[1], recipe.dilate), HoleType.OBJECT)


def left_filler(filler: Inpainter, pair: MatchedPair, recipe: Recipe) -> Inpainter:
    """The filler of the left view; one for pairs sees the right picture too, without the object."""
    if isinstance(filler, PairFiller):
        unknown = np.zeros(pair.rig.right.hw, bool) if pair.masks is None else dilated(pair.masks[1], recipe.dilate)
        filler = filler.painter(pair.colors[1], unknown, left=True)
    return filler_of_recipe(filler, recipe)


def right_filler(filler: Inpainter, left: View, recipe: Recipe) -> Inpainter:
    """The filler of the right view; one for pairs sees the completed left view too."""
    if isinstance(filler, PairFiller):
        filler = filler.painter(left.color, np.zeros(left.hole.shape, bool), left=False)
    return filler_of_recipe(filler, recipe)
