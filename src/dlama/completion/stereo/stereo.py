"""A rectified pair and its rig in; depth, both views completed alike, disparities out (paper: SII).

match -> remove -> left view: what the right camera saw there, then fill -> right view: likewise -> fuse

What one camera measured is used before anything is guessed, and both views agree by construction. The paper fills each view
alone and matches afterwards (recipe `paper`); without an object it makes the right view from the left (right_view
`synthesised`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from dlama.arguments import check_arguments, check_word
from dlama.completion.completion import StereoCompletion
from dlama.completion.memory import check_memory
from dlama.completion.options import OptionKeywords, Unpack, options_of, take_options
from dlama.completion.recipes import Recipe
from dlama.completion.report import Clock, warn_of_disparity, warn_of_scale
from dlama.completion.start import (
    Plan,
    choose_filler,
    filler_of_recipe,
    scene_of,
    warn_of_mask,
)
from dlama.completion.steps import complete_frame, frames_to_fill
from dlama.completion.stereo.disparities import match_pair
from dlama.completion.stereo.exchange import (
    add_seen_alone,
    apply_gain,
    color_gain,
    continue_depth,
    transfer_hidden,
    transferred_share,
)
from dlama.completion.stereo.pair import (
    MatchedPair,
    check_pair_inputs,
    completion_of_pair,
    masks_of_pair,
    with_object_depth,
    without_object,
)
from dlama.completion.stereo.published import complete_pair_one_by_one
from dlama.errors import InputError
from dlama.geometry.camera import Float64Array, StereoRig
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.frames.removal import mask_growth
from dlama.geometry.fusion import close_holes, fuse
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters.filling import FillReport, Inpainter, inpaint
from dlama.inpainters.networks.pair import PairFiller
from dlama.perception.stereo.matching import Matcher
from dlama.progress import Progress, take_progress

RightView = Literal["given", "synthesised"]
"""What becomes of the right picture where no object is removed."""


@take_options
@take_progress
def stereo(
    left: UInt8Array,
    right: UInt8Array,
    rig: StereoRig,
    *,
    mask: BoolArray | Callable[[RGBD], BoolArray] | None = None,
    mask_right: BoolArray | None = None,
    right_view: RightView | None = None,
    disparity: Float32Array | None = None,
    matcher: str | Path | Matcher | None = None,
    max_disparity: float | None = None,
    far: float | None = None,
    progress: Progress | None = None,
    **options: Unpack[OptionKeywords],
) -> StereoCompletion:
    """Depth from a rectified pair; with `mask` the object is removed from both views.

    Args:
        left: uint8 H x W x 3, RGB.
        right: uint8 H x W x 3, RGB.
        rig: The two cameras.
        mask: H x W bool of the left view, True = remove; or a function that finds it in the left picture with its matched depth.
        mask_right: H x W bool of the right view; default: the left mask carried over by disparity.
        right_view: "given": both pictures stay bit for bit and both get depth; "synthesised": the right view is made from the
            left one, without a mask only. Default: given; synthesised by a recipe that fills the new view first (paper).
        disparity: H x W px of the left view, 0 = unknown; default: found.
        matcher: what finds it: an ONNX network with a contract (`dlama.perception.stereo.networks`), or a function
            (left, right) -> both disparities, as `disparity`; default: semi-global matching.
        max_disparity: px, the largest disparity looked for; default: found.
        far: metres; what is measured at or beyond it is far (sky); default: what half a pixel of disparity cannot distinguish
            from infinity.
        progress: Called with the name of each stage as it begins; what it raises ends the work.
        options: How the views are completed (`Options`).

    Raises:
        InputError: options that contradict each other, pictures of another size than the rig's (ShapeError), a mask that
            cannot be used (MaskError).
    """
    check_arguments(stereo, locals())
    left, right = check_pair_inputs(left, right, rig, far)
    if mask is None and mask_right is not None:
        raise InputError("`mask_right` was given without `mask`; the mask of the left view is expected too")
    given = options_of(options)
    chosen = given.settings
    check_memory((rig.left, rig.right))
    choice = choose_filler(False, given.filler, given.model)
    if isinstance(choice.inpainter, PairFiller) and chosen.depth_by != "surfaces":
        raise InputError(
            f"`depth_by` is {chosen.depth_by!r} and the filler 'pair', which fills no depth; surfaces is expected"
        )
    complete_pair = choose_steps(chosen, right_view, mask is not None, disparity is not None)
    clock = Clock()
    with clock("match"):
        pair = match_pair((left, right), rig, far, disparity=disparity, matcher=matcher, max_disparity=max_disparity)
    warn_of_scale(pair.left.depth)
    warn_of_disparity(pair.left, pair.far if far is None and disparity is not None else None)
    found = mask(pair.left) if callable(mask) else mask
    masks = masks_of_pair(found, mask_right, pair)
    start, decisions = scene_of(pair.left), choice.decision
    if masks is not None:
        pair = dataclasses.replace(pair, masks=masks)
        warn_of_mask(masks[0])
        growth = mask_growth(start, chosen.dilate)
        chosen, decisions = dataclasses.replace(chosen, dilate=growth.px), decisions | {"mask_growth": growth._asdict()}
    draft = Plan(chosen, choice.inpainter, given.seed, start, choice.name, decisions)
    return complete_pair(pair, draft, clock).with_min_confidence(given.min_confidence)


def choose_steps(
    recipe: Recipe, right_view: RightView | None, removing: bool, matched: bool
) -> Callable[[MatchedPair, Plan, Clock], StereoCompletion]:
    """How a pair is completed. InputError: an unknown name, synthesised with a mask, a pair that is matched anew but was
    `matched` already."""
    if right_view is not None:
        check_word(right_view, "right_view", get_args(RightView))
    if not removing:
        made = right_view == "synthesised" if right_view else not recipe.source_first
        return synthesise_right if made else complete_pair_together
    if right_view == "synthesised":
        raise InputError("`right_view` is 'synthesised' and a mask is given; with a mask both pictures are completed")
    if recipe.source_first:
        return complete_pair_together
    if matched:
        raise InputError(
            f"`disparity` is given and the recipe {recipe.name!r} matches the filled pictures anew; a matcher is expected"
        )
    return complete_pair_one_by_one


def complete_pair_together(pair: MatchedPair, draft: Plan, clock: Clock) -> StereoCompletion:
    """Both views completed: each first by what the other camera measured, then what neither did, filled in the left view."""
    clean, gain = pair.without_bleeding(), color_gain(pair)
    recipe, filler = draft.recipe, draft.inpainter
    scene, grown_mask = without_object(clean, recipe)
    right_before = View.from_rgbd(clean.right.clip_depth(recipe.clip))
    if pair.masks is not None:
        right_before = right_before.without(dilate_mask(pair.masks[1], recipe.dilate or 0), HoleType.OBJECT)
    own = filler_next_to(filler, right_before, recipe, left=True)
    lawful = with_object_depth(scene, pair.object_depth)
    both = dataclasses.replace(lawful, fills=(right_before,))  # what the right picture measured counts for the law too
    plan = dataclasses.replace(draft, inpainter=own, measured=both)
    context = plan.context

    with clock("exchange"):
        other = right_before if pair.masks is None else continue_depth(right_before, context, plan.seed)
        other = apply_gain(other, gain)
    left, left_fill, scene = complete_left(plan, scene, other, clock)
    with clock("fuse"):
        if pair.masks is not None:
            scene = add_seen_alone(scene, other, context.law, recipe.mode)
        scene = fuse(scene, left)
    next_to_left = filler_next_to(filler, left, recipe, left=False)
    right_plan = dataclasses.replace(plan, inpainter=next_to_left)
    right, right_fills, scene = complete_right(right_plan, scene, right_before, gain, pair.masks is not None, clock)
    left_before = left_before_filling(clean.left, scene)
    before, views = (left_before, right_before), (left, right)
    return completion_of_pair(
        clean,
        plan,
        before,
        views,
        scene,
        [left_fill, *right_fills],
        clock.seconds,
        grown_mask,
        right="given",
        gain=[round(float(value), 4) for value in gain],
        transferred_share=[transferred_share(*both) for both in zip(views, before)],
    )


def complete_left(plan: Plan, scene: Scene, other: View, clock: Clock) -> tuple[View, FillReport, Scene]:
    """The left view completed, first by what the `other` one measured, and the scene with its depth."""
    open_left = scene.frames[0].load()
    with clock("exchange"):
        known = transfer_hidden(open_left, other, plan.context.law, plan.recipe.mode)
    with clock("fill"):
        left, report = inpaint(known, plan.inpainter, plan.context, plan.seed)
    with clock("fuse"):
        guessed_or_transferred = open_left.color_hole
        measured = left.without(guessed_or_transferred, HoleType.OBJECT)
    return left, report, dataclasses.replace(scene, frames=(measured,))


def complete_right(
    plan: Plan, scene: Scene, before: View, gain: Float64Array, removing: bool, clock: Clock
) -> tuple[View, list[FillReport], Scene]:
    """The right view (`before` filling) completed, first by what the scene shows there, and the scene with what is new in it."""
    context, mode = plan.context, plan.recipe.mode
    with clock("render"):
        shown = apply_gain(render(scene, before.camera, mode, types=False, close=False), 1 / gain)
    known, moved = close_holes(context.law, before, shown, measured=True)
    with clock("fill"):
        right, report = inpaint(known, plan.inpainter, context, plan.seed)
    with clock("fuse"):
        as_left = apply_gain(right, gain)
        if not removing:
            scene = add_seen_alone(scene, as_left, context.law, mode)
        own_depth = right.origin == Origin.DEPTH_FILLED.value  # added above where the left picture does not have it
        scene = fuse(scene, as_left.without(own_depth, HoleType.NONE), before.hole & ~known.hole)
    return right, [FillReport(law_moves=moved), report], scene


def synthesise_right(pair: MatchedPair, draft: Plan, clock: Clock) -> StereoCompletion:
    """The left view completed, and the right one made from it; of the right picture only the disparity is used."""
    source, recipe, filler = pair.left, draft.recipe, draft.inpainter
    scene = measured = scene_of(source, recipe.clip)
    own = filler_next_to(filler, View.from_rgbd(pair.right), recipe, left=True)
    plan = dataclasses.replace(draft, inpainter=own, measured=measured)
    fills: list[FillReport] = []
    for place in frames_to_fill(plan, measured, ()):
        found, scene = complete_frame(plan, scene, place, clock)
        fills += found.reports
    with clock("fill"):
        open_left = render(scene, pair.rig.left, recipe.mode, close=False)
        left, left_fill = inpaint(open_left, plan.inpainter, plan.context, plan.seed)
    left_before = left_before_filling(source, scene)
    left = dataclasses.replace(
        left, hole_type=np.where(left_before.hole_type > 0, left_before.hole_type, left.hole_type)
    )
    with clock("render"):
        right_before = render(scene, pair.rig.right, recipe.mode, close=False)
    with clock("fill"):
        right, right_fill = inpaint(
            right_before, filler_next_to(filler, left, recipe, left=False), plan.context, plan.seed
        )
    with clock("fuse"):
        scene = fuse(scene, right)
    before, fills = (left_before, right_before), [*fills, left_fill, right_fill]
    return completion_of_pair(pair, plan, before, (left, right), scene, fills, clock.seconds, right="synthesised")


def left_before_filling(source: RGBD, scene: Scene) -> View:
    """The left view with its sensor holes open, and the object where `scene` has one removed."""
    return View.from_rgbd(source).without(scene.frames[0].load().object_hole, HoleType.OBJECT)


def filler_next_to(filler: Inpainter, other: View, recipe: Recipe, *, left: bool) -> Inpainter:
    """The filler of the left (or the right) view; one for pairs sees the other view too, but for what is not known of it."""
    if isinstance(filler, PairFiller):
        filler = filler.painter(other.color, other.color_hole, left=left)
    return filler_of_recipe(filler, recipe)
