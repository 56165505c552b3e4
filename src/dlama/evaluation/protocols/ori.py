"""ORI, an object removed: a frame with it, its mask, the frame without it and a method in; scores out.

Regions: `mask` (as given, before a recipe dilates it), `ring` (`ring_px` round it: a recipe's dilation ends here), `outside`
(beyond the ring: nothing may change, `changed_pixels` counts against the source), `shadow` (the object's, never removed by the
mask: the data set's own, or what is darker with the object than without). Where the data set says which pixels are comparable,
errors against the truth count only there.
The restored background is also scored as a cloud: c-'s filled points against the truth's points, both inside the mask.

Variants `mask-9` ... `mask+9` remove with an eroded or dilated mask (px, before the recipe's own dilation); the regions stay.
The baseline that fills nothing leaves the object black and without depth: no metres and no cloud there.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dlama.datasets.frames import RemovalTruth, Truth
from dlama.evaluation.metrics.depth import cloud_scores
from dlama.evaluation.metrics.pictures import channel_gain, depth_8bit, mse_map, region_mean
from dlama.evaluation.metrics.regions import SMALLEST_SHADOW_PX, darkened_by_shadow, removal_regions
from dlama.evaluation.protocols.methods import (
    Measure,
    Method,
    MethodRun,
    ProtocolSettings,
    Scored,
    measures_of,
    run_method,
)
from dlama.evaluation.protocols.scores import (
    Gain,
    Reference,
    artifact_measures,
    picture_panel,
    reliability_measures,
    view_measures,
)
from dlama.geometry.codes import HoleType, from_filler
from dlama.geometry.holes import grow_or_shrink
from dlama.geometry.projection import lift, project_to_pixels
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.view import View


def score(truth: Truth, method: Method, settings: ProtocolSettings) -> list[Scored]:
    """The plain run, with its panel, and one run for each change of the mask that leaves something of it."""
    assert isinstance(truth, RemovalTruth)
    run, measures = run_with(truth.mask, truth, method, settings)
    shown = picture_panel(run, reference_of(truth, settings), truth.source, truth.without)
    scored = [Scored(measures, panel=shown, view=run.view())]
    for change in filter(None, settings.mask_changes):
        mask = grow_or_shrink(truth.mask, change)
        if mask.any() and not mask.all():
            _, measures = run_with(mask, truth, method, settings)
            scored.append(Scored(measures, f"mask{change:+d}"))
    return scored


def run_with(
    mask: BoolArray, truth: RemovalTruth, method: Method, settings: ProtocolSettings
) -> tuple[MethodRun, tuple[Measure, ...]]:
    """One run, with this mask, and all its numbers."""
    run, reference = run_method(method, truth.source, truth.source.camera, mask), reference_of(truth, settings)
    view, inside = run.view(), reference.within(truth.mask)
    return run, (
        *view_measures(run, reference),
        *change_outside(view, truth.source, reference.regions["outside"]),
        *cloud_measures(run, truth.without, inside),
        *reliability_measures(run, reference),
        *artifact_measures(run, view, reference, "mask", inside, truth.without, truth.source),
    )


@lru_cache(maxsize=1)
def reference_of(truth: RemovalTruth, settings: ProtocolSettings) -> Reference:
    """The frame without the object and its regions, made once for all methods and masks of a case."""
    shadow = find_true_shadow(truth)
    regions = removal_regions(truth.mask, shadow, settings.ring_px)
    return Reference(
        truth.without.color,
        truth.without.depth,
        regions,
        settings,
        truth.compare,
        removal_gain(truth, shadow, regions["outside"]),
    )


def find_true_shadow(truth: RemovalTruth) -> BoolArray | None:
    """H x W, True = the cast shadow: the data set's own, else what the object darkens; None: hardly any, or not known."""
    if truth.shadow is not None or truth.exposure_varies:
        return truth.shadow
    found = darkened_by_shadow(truth.source.color, truth.without.color, truth.mask)
    return found if found.sum() >= SMALLEST_SHADOW_PX else None


def removal_gain(truth: RemovalTruth, shadow: BoolArray | None, outside: BoolArray) -> Gain:
    """What brings the source to the exposure of the frame without the object, by what both show."""
    if not truth.exposure_varies:
        return (1.0, 1.0, 1.0)
    both = outside if truth.compare is None else outside & truth.compare
    if shadow is not None:
        both = both & ~shadow
    return channel_gain(truth.source.color, truth.without.color, both)


def change_outside(view: View, source: RGBD, outside: BoolArray) -> list[Measure]:
    """What changed beyond the ring, against the source: colour, and 8-bit depth where the source has depth."""
    changed = (view.color != source.color).any(2)
    mine, given = depth_8bit(view.depth), depth_8bit(source.depth)
    measured = outside & ~source.missing
    return [
        Measure("outside", "rgb", "changed_pixels", float((changed & outside).sum())),
        Measure("outside", "rgb", "mse_source", region_mean(mse_map(source.color, view.color), outside)),
        Measure("outside", "depth", "changed_pixels", float(((mine != given) & measured).sum())),
        Measure("outside", "depth", "mse_source", region_mean(mse_map(given, mine), measured)),
    ]


def cloud_measures(run: MethodRun, without: RGBD, inside: BoolArray) -> list[Measure]:
    """Accuracy, completeness and F-scores of the restored background inside the mask."""
    truth = lift(View.from_rgbd(without).without(~inside, HoleType.NONE))
    if not run.method.fills or not len(truth):
        return []
    cloud = run.completion.background
    filled = np.asarray(cloud.points[from_filler(cloud.origin)])
    row, column, _, lands = project_to_pixels(filled, without.camera)
    return measures_of("mask", "cloud", cloud_scores(filled[lands & inside[row, column]], np.asarray(truth.points)))
