"""MASK, an object pointed at: a frame with it and its true mask in; how well masks are found, and its removal with them, out.

Each mask that clicks, boxes and GrabCut find (`dlama.evaluation.protocols.pointing`) is a region with `iou` and `border_f` of
modality `mask`.

The method removes the object with the mask of one click; variant `clicks-2` with that of one click and one correction,
`true-mask` with the true one, `with-shadow` with its shadow too. Errors are taken in ORI's regions, `mask` being the true one.
Region `shadow`, modality `mask`: which pixels that the object darkens by a tenth or more (`darkened_by_shadow`) are found with
the true mask; `false_alarm`: % of the picture found where there is none. The contact line, within 2 px of the object, is not
scored.
"""

from __future__ import annotations

from functools import lru_cache

from dlama.datasets.frames import RemovalTruth, Truth
from dlama.errors import InputError
from dlama.evaluation.metrics.masks import (
    SMALLEST_SHADOW_PX,
    border_f,
    darkened_by_shadow,
    outside_contact_band,
)
from dlama.evaluation.protocols.methods import Measure, Method, ProtocolSettings, Scored, run_method
from dlama.evaluation.protocols.ori import reference_of
from dlama.evaluation.protocols.pointing import CLICKS, find_masks
from dlama.evaluation.protocols.scores import picture_panel
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import BoolArray
from dlama.perception.shadows.find import find_shadow


def score(truth: Truth, method: Method, settings: ProtocolSettings) -> list[Scored]:
    """The masks, and the removal with that of one click; then after a correction, with the true mask, and with the shadow.

    Raises:
        InputError: not a RemovalTruth, an empty mask, or what the completion raises.
    """
    if not isinstance(truth, RemovalTruth) or not truth.mask.any():
        raise InputError(f"mask: the case holds a {type(truth).__name__}; a RemovalTruth with a mask is expected")
    masks, seconds = find_masks(truth)
    measures = [
        Measure(name, "mask", metric, value)
        for name, mask in masks.items()
        for metric, value in (("iou", iou(mask, truth.mask)), ("border_f", border_f(mask, truth.mask)))
    ]
    measures += [*shadow_measures(truth), Measure("click", "time", "seconds", seconds)]
    found, shadow = masks["click"], detect_shadow(truth)
    removals = {"": found, CLICKS[1]: masks[CLICKS[1]], "true-mask": truth.mask, "with-shadow": found | shadow}
    if not settings.mask_changes:
        removals = {"": found}
    scored = []
    for variant, mask in removals.items():
        scored.append(score_removal_with(truth, method, settings, mask, variant, measures if not variant else []))
    return scored


def score_removal_with(
    truth: RemovalTruth, method: Method, settings: ProtocolSettings, mask: BoolArray, variant: str, more: list[Measure]
) -> Scored:
    """The object removed by a mask (nothing is removed where that is empty or full), measured in the true regions."""
    usable = mask if mask.any() and not mask.all() else None
    run = run_method(method, truth.source, truth.source.camera, usable)
    reference, view = reference_of(truth, settings), run.view()
    measures = [
        *more,
        *reference.color_measures(view.color),
        *reference.depth_measures(view.depth),
        *reference.metre_measures(view.depth, run.without_depth()),
        *reference.shares(),
        run.timing(),
    ]
    panel = None if variant else picture_panel(run, reference, truth.source, truth.without)
    return Scored(tuple(measures), variant, panel, run.completion.meta)


@lru_cache(maxsize=1)
def detect_shadow(truth: RemovalTruth) -> BoolArray:
    """The shadow of the object under the true mask, as `with_shadow` finds it."""
    return find_shadow(truth.source, truth.mask)


def shadow_measures(truth: RemovalTruth) -> list[Measure]:
    """Recall and precision in pixels; where there is no shadow the share of the picture that is taken for one, in percent."""
    found = detect_shadow(truth) & outside_contact_band(truth.mask)
    true = darkened_by_shadow(truth.source.color, truth.without.color, truth.mask)
    if truth.compare is not None:
        found, true = found & truth.compare, true & truth.compare
    if true.sum() < SMALLEST_SHADOW_PX:
        return [Measure("shadow", "mask", "false_alarm", 100 * float(found.mean()))]
    both = float((found & true).sum())
    measures = [Measure("shadow", "mask", "recall", both / float(true.sum()))]
    if found.any():
        measures.append(Measure("shadow", "mask", "precision", both / float(found.sum())))
    return measures
