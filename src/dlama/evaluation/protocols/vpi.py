"""VPI, a virtual view (paper, sec. 4 and 5, tables 1 and 2): a source and a true target frame and a method in; scores out.

The source goes to the target's camera; the result is compared with the true frame in `whole`, `seen` (errors of warping),
`unseen` and each type. The paper's second experiment removes an object first and compares with the frame without it:
variants `object,dilate=0` and so on; the number is the mask's dilation in px and replaces the recipe's own.

The baseline that fills nothing leaves black, depthless holes: colours and 8-bit depth are compared as they are (0 in holes),
metres only where it has any.
"""

from __future__ import annotations

from functools import lru_cache

from dlama.datasets.frames import Truth, ViewTruth
from dlama.evaluation.metrics.pictures import channel_gain
from dlama.evaluation.metrics.regions import source_visibility
from dlama.evaluation.metrics.reliability import color_tolerance
from dlama.evaluation.protocols.methods import Method, ProtocolSettings, Scored, run_method
from dlama.evaluation.protocols.scores import (
    Reference,
    artifact_measures,
    leak_measures,
    picture_panel,
    reliability_measures,
    view_measures,
)
from dlama.geometry.rgbd import RGBD, brighten
from dlama.inpainters.confidence import COLOR_WITHIN


def score(truth: Truth, method: Method, settings: ProtocolSettings) -> list[Scored]:
    """The plain run, with its panel, and the runs of the second experiment, where the truth has what they need."""
    assert isinstance(truth, ViewTruth)
    scored = [score_view(truth, method, settings)]
    if truth.object_mask is not None and truth.target_without is not None and truth.object_mask.any():
        scored += [score_view(truth, method, settings, dilate) for dilate in settings.object_dilations]
    return scored


def score_view(truth: ViewTruth, method: Method, settings: ProtocolSettings, dilate: int | None = None) -> Scored:
    """The plain run; with `dilate` one in which the object is removed first, its mask dilated by so many px."""
    removed = dilate is not None
    reference, target = target_reference(truth, settings, removed), target_frame(truth, removed)
    changes = {"dilate": dilate} if removed else {}
    run = run_method(method, truth.source, truth.target.camera, truth.object_mask if removed else None, **changes)
    measures = [
        *view_measures(run, reference),
        *leak_measures(run, target, reference.regions["seen"]),
        *reliability_measures(run, reference),
        *artifact_measures(run, run.view(), reference, "unseen", reference.regions["unseen"], target, truth.source),
    ]
    panel = None if removed else picture_panel(run, reference, truth.source, target)
    variant, view = (f"object,dilate={dilate}", None) if removed else ("", run.view())
    return Scored(tuple(measures), variant, panel, view)


def target_frame(truth: ViewTruth, without_object: bool) -> RGBD:
    """The target frame, or that without the object."""
    found = truth.target_without if without_object else truth.target
    assert found is not None
    return found


@lru_cache(maxsize=2)
def target_reference(truth: ViewTruth, settings: ProtocolSettings, without_object: bool = False) -> Reference:
    """The target frame with regions by what the source sees of it, made once for all methods of a case; with `without_object`
    what the object hides is a type of its own. Gain and tolerance of colours: of the source carried over by the true depth."""
    target = target_frame(truth, without_object)
    found = source_visibility(truth.source, target, truth.object_mask if without_object else None)
    gain, carried = (1.0, 1.0, 1.0), found.warp_color(truth.source.color)
    if truth.exposure_varies:
        gain = channel_gain(carried, target.color, found.seen)
    shown = None if target.padding is None else ~target.padding
    within = color_tolerance(brighten(carried, gain), target.color, found.seen, COLOR_WITHIN)
    regions = found.regions(without_object)
    return Reference(target.color, target.depth, regions, settings, shown, gain, color_within=within)
