"""What only the published recipe does (D-LaMa, sec. 3 and 4): depth clipped at 10 m; the pictures of a pair filled one by one."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.completion.recipes import Recipe
from dlama.completion.report import Clock, Record
from dlama.completion.steps import Plan, fill, filler_of_recipe, law_of, take_out
from dlama.completion.stereo.pair import CompletedPair, MatchedPair
from dlama.geometry.holes import dilated
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, Origin, View
from dlama.inpainters.filling import FillReport, Inpainter


def clipped(rgbd: RGBD, clip: float | None) -> RGBD:
    """The picture with everything at or beyond `clip` metres, sky too, at `clip`; as it is where `clip` is None."""
    if clip is None:
        return rgbd
    return dataclasses.replace(rgbd, depth=np.minimum(rgbd.depth, np.float32(clip)))


def complete_pair_one_by_one(
    pair: MatchedPair, recipe: Recipe, filler: Inpainter, seed: int, clock: Clock
) -> CompletedPair:
    """The object removed from each picture of a pair, colour filled in each alone, then matched: depth is what matching finds."""
    assert pair.masks is not None
    given, grown_mask = take_out(View.from_rgbd(clipped(pair.left, recipe.clip)), pair.masks[0], recipe.dilate)
    flat = [RGBD(one.color, np.ones(one.color.shape[:2], np.float32), one.camera) for one in (pair.left, pair.right)]
    plans: list[Plan] = []
    before: list[View] = []
    filled: list[View] = []
    fills: list[FillReport] = []
    for source, mask in zip(map(View.from_rgbd, flat), pair.masks):
        alone = Scene((source,))
        plans.append(Plan(recipe, filler_of_recipe(filler, recipe), seed, alone, law_of(alone, recipe)))
        before.append(source.without(dilated(mask, recipe.dilate), HoleType.OBJECT))
        with clock("fill"):
            view, report = fill(plans[-1], before[-1])
        filled.append(view)
        fills.append(report)
    with clock("match"):
        disparities = pair.match(filled[0].color, filled[1].color)
    again = dataclasses.replace(pair, colors=(filled[0].color, filled[1].color), disparities=disparities)
    left, right = (
        with_origin_of(View.from_rgbd(clipped(one, recipe.clip)), view)
        for one, view in zip((again.left, again.right), filled)
    )
    record = Record(fills, clock.seconds, grown_mask)
    scene = Scene((left,), given.objects)
    return CompletedPair(plans[0], pair.left, (before[0], before[1]), (left, right), scene, record, {"right": "given"})


def with_origin_of(matched: View, filled: View) -> View:
    """A view with matched depth, and with the origin and hole types of its filled colours."""
    return dataclasses.replace(
        matched,
        origin=np.where(filled.filled, np.uint8(Origin.FILLED), matched.origin),
        hole_type=np.where(filled.hole_type > 0, filled.hole_type, matched.hole_type),
    )
