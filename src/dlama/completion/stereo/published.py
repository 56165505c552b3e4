"""A pair and the published recipe (D-LaMa, sec. 3 and 4) in; its pictures, filled one by one and then matched, out."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.completion.completion import StereoCompletion
from dlama.completion.report import Clock
from dlama.completion.start import Plan, filler_of_recipe
from dlama.completion.stereo.pair import MatchedPair, completion_of_pair, without_object
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters.filling import FillReport, inpaint


def complete_pair_one_by_one(pair: MatchedPair, draft: Plan, clock: Clock) -> StereoCompletion:
    """The object removed from each picture of a pair, colour filled in each alone, then matched: depth is what matching finds."""
    assert pair.masks is not None
    recipe, inpainter = draft.recipe, filler_of_recipe(draft.inpainter, draft.recipe)
    scene, grown_mask = without_object(pair, recipe)
    cameras = pair.rig.left, pair.rig.right
    flat = [RGBD(color, np.ones(camera.hw, np.float32), camera) for color, camera in zip(pair.colors, cameras)]
    before: list[View] = []
    filled: list[View] = []
    fills: list[FillReport] = []
    for source, mask in zip(map(View.from_rgbd, flat), pair.masks):
        context = dataclasses.replace(draft, measured=Scene((source,))).context
        before.append(source.without(dilate_mask(mask, recipe.dilate or 0), HoleType.OBJECT))
        with clock("fill"):
            view, report = inpaint(before[-1], inpainter, context, draft.seed)
        filled.append(view)
        fills.append(report)
    with clock("match"):
        disparities = pair.match(filled[0].color, filled[1].color)
    again = dataclasses.replace(pair, colors=(filled[0].color, filled[1].color), disparities=disparities)
    left, right = (
        with_origin_of(View.from_rgbd(one.clip_depth(recipe.clip)), view)
        for one, view in zip((again.left, again.right), filled)
    )
    views, completed = (left, right), Scene((left,), scene.removals)
    return completion_of_pair(
        pair, draft, (before[0], before[1]), views, completed, fills, clock.seconds, grown_mask, right="given"
    )


def with_origin_of(matched: View, filled: View) -> View:
    """A view with matched depth, and with the origin, the hole types and at most the confidence of its filled colours."""
    return dataclasses.replace(
        matched,
        origin=np.where(filled.filled, np.uint8(Origin.FILLED), matched.origin),
        confidence=np.where(filled.filled, np.minimum(filled.confidence, matched.confidence), matched.confidence),
        hole_type=np.where(filled.hole_type > 0, filled.hole_type, matched.hole_type),
    )
