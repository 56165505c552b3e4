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
from dlama.errors import InputError
from dlama.evaluation.metrics.pictures import channel_gain, with_gain
from dlama.evaluation.metrics.regions import source_visibility
from dlama.evaluation.metrics.reliability import color_tolerance
from dlama.evaluation.protocols.methods import Measure, Method, MethodRun, ProtocolSettings, Scored, run_method
from dlama.evaluation.protocols.reliability import reliability_measures
from dlama.evaluation.protocols.scores import Reference, artifact_measures, leak_measures, picture_panel
from dlama.geometry.rgbd import RGBD
from dlama.inpainters.confidence import COLOR_WITHIN


def score(truth: Truth, method: Method, settings: ProtocolSettings) -> list[Scored]:
    """The plain run, with its panel, and the runs of the second experiment, where the truth has what they need.

    Raises:
        InputError: not a ViewTruth, or what the completion raises.
    """
    if not isinstance(truth, ViewTruth):
        raise InputError(f"vpi: the case holds a {type(truth).__name__}; a ViewTruth is expected")
    scored = [score_plain(truth, method, settings)]
    if truth.object_mask is not None and truth.target_without is not None and truth.object_mask.any():
        scored += [score_without(truth, method, settings, dilate) for dilate in settings.object_dilations]
    return scored


def score_plain(truth: ViewTruth, method: Method, settings: ProtocolSettings) -> Scored:
    """The plain run: nothing is removed."""
    reference = target_reference(truth, settings)
    run = run_method(method, truth.source, truth.target.camera)
    measures = view_measures(run, reference, truth, truth.target) + reference.shares()
    return Scored(
        tuple(measures), panel=picture_panel(run, reference, truth.source, truth.target), meta=run.completion.meta
    )


def score_without(truth: ViewTruth, method: Method, settings: ProtocolSettings, dilate: int) -> Scored:
    """One run in which the object is removed first; its mask is dilated by so many px."""
    assert truth.target_without is not None
    reference = reference_without(truth, settings)
    run = run_method(method, truth.source, truth.target.camera, truth.object_mask, dilate=dilate)
    measures = view_measures(run, reference, truth, truth.target_without) + reference.shares()
    return Scored(tuple(measures), f"object,dilate={dilate}", meta=run.completion.meta)


def view_measures(run: MethodRun, reference: Reference, truth: ViewTruth, target: RGBD) -> list[Measure]:
    """All numbers of one run."""
    view = run.view()
    return [
        *run.hole_shares(),
        *reference.color_measures(view.color),
        *reference.depth_measures(view.depth),
        *reference.metre_measures(view.depth, run.without_depth()),
        *leak_measures(run, target, reference.regions["seen"]),
        *reliability_measures(run, reference),
        *artifact_measures(
            run, view, reference.match_exposure(view.color), reference.regions["unseen"], "unseen", target, truth.source
        ),
        run.timing(),
    ]


@lru_cache(maxsize=1)
def target_reference(truth: ViewTruth, settings: ProtocolSettings) -> Reference:
    """The target frame and its regions, made once for all methods of a case."""
    return reference_of(truth, truth.target, settings, with_object=False)


@lru_cache(maxsize=1)
def reference_without(truth: ViewTruth, settings: ProtocolSettings) -> Reference:
    """The target frame without the object; what the object hides is a type of its own."""
    assert truth.target_without is not None
    return reference_of(truth, truth.target_without, settings, with_object=True)


def reference_of(truth: ViewTruth, target: RGBD, settings: ProtocolSettings, with_object: bool) -> Reference:
    """A target with regions by what the source sees of it; gain and tolerance of colours are those of the source carried over by
    the true depth."""
    found = source_visibility(truth.source, target, truth.object_mask if with_object else None, settings.seen_tolerance)
    gain, carried = (1.0, 1.0, 1.0), found.warp_color(truth.source.color)
    if truth.exposure_varies:
        gain = channel_gain(carried, target.color, found.seen)
    shown = None if target.padding is None else ~target.padding
    within = color_tolerance(with_gain(carried, gain), target.color, found.seen, COLOR_WITHIN)
    return Reference(target.color, target.depth, found.regions(with_object), settings, shown, gain, color_within=within)
