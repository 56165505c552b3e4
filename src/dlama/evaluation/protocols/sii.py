"""SII, a stereo pair: pictures, rig, true disparity and a method in; scores out. Regions of the right view end in `-right`.

With masks the object is removed in both views: colour of each view in `mask` and `mask-right`; disparity, depth, cloud and
edges in the left view's `mask`. Left and right fills are held against each other in the mask (mean absolute difference in
grey levels): `photometric` by the method's own disparity, `photometric_at_truth` by the true one, and
`photometric_truth`, what the true pictures reach.

Without masks the right view is synthesised from the left picture with its true disparity, and compared with the true right
picture in what the left camera sees of it and what not; these regions are of the only view there is, so they have no
suffix. Variant `sgm`: the method finds the disparity itself. Depth in metres is scored only where the rig is metric.
The baseline that fills nothing is scored in colour only where it would have no depth.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import numpy as np

from dlama.completion.completion import StereoCompletion
from dlama.completion.stereo.stereo import stereo
from dlama.datasets.frames import StereoTruth, Truth
from dlama.errors import InputError
from dlama.evaluation.metrics.depth import disparity_errors, left_right_difference
from dlama.evaluation.metrics.regions import stereo_regions
from dlama.evaluation.protocols.methods import (
    Measure,
    Method,
    MethodRun,
    ProtocolSettings,
    Scored,
    measures_of,
    run_method,
    timed_run,
)
from dlama.evaluation.protocols.ori import cloud_measures
from dlama.evaluation.protocols.scores import (
    Reference,
    artifact_measures,
    leak_measures,
    picture_panel,
    reliability_measures,
    view_measures,
)
from dlama.geometry.projection import depth_from_disparity, disparity_from_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array

RIGHT = "-right"


def score(truth: Truth, method: Method, settings: ProtocolSettings) -> list[Scored]:
    """The plain run, with its panel; without masks also the run that finds the disparity itself. InputError: masks without true
    frames."""
    assert isinstance(truth, StereoTruth)
    if truth.mask_left is not None:
        return [score_removal(truth, method, settings)]
    source = RGBD(truth.left, depth_from_disparity(truth.disparity_left, truth.rig), truth.rig.left)
    scored = [score_right(truth, run_method(method, source, truth.rig.right), source, settings, "")]
    if settings.matched_stereo:
        scored.append(score_right(truth, run_stereo(truth, method), source, settings, "sgm"))
    return scored


def run_stereo(truth: StereoTruth, method: Method) -> MethodRun:
    """`dlama.completion.stereo.stereo` on the pair, with the masks where there are any."""
    right_view: Any = "given" if truth.mask_left is not None else "synthesised"
    masks: Any = {"mask": truth.mask_left, "mask_right": truth.mask_right}
    return timed_run(method, partial(stereo, truth.left, truth.right, truth.rig, **masks, right_view=right_view))


def score_removal(truth: StereoTruth, method: Method, settings: ProtocolSettings) -> Scored:
    """The run in which the object is removed from both views."""
    left, right = removal_references(truth, settings)
    run = run_stereo(truth, method)
    measures = [
        *run.hole_shares(0),
        *run.hole_shares(1, RIGHT),
        *left.color_measures(run.view(0).color),
        *right.color_measures(run.view(1).color),
        *left.shares(),
        *right.shares(),
        run.timing(),
    ]
    assert truth.mask_left is not None and truth.without_left is not None
    if run.method.fills:
        view = run.view(0)
        measures += [*left.depth_measures(view.depth), *left.metre_measures(view.depth)]
        measures += reliability_measures(run, left, 0)
        if truth.metric:
            measures += cloud_measures(run, truth.without_left, truth.mask_left)
        measures += pair_measures(run, truth, truth.mask_left)
        measures += artifact_measures(run, view, left, "mask", truth.mask_left, truth.without_left, None)
    source = RGBD(truth.left, depth_from_disparity(truth.disparity_left, truth.rig), truth.rig.left)
    shown = picture_panel(run, left, source, truth.without_left, 0)
    return Scored(tuple(measures), panel=shown, view=run.view(0))


@lru_cache(maxsize=1)
def removal_references(truth: StereoTruth, settings: ProtocolSettings) -> tuple[Reference, Reference]:
    """Both true views without the object, made once for all methods of a case."""
    frames, masks = (truth.without_left, truth.without_right), (truth.mask_left, truth.mask_right)
    references = []
    for frame, mask, suffix in zip(frames, masks, ("", RIGHT)):
        if frame is None or mask is None:
            raise InputError("sii: a mask is given, but not both masks with both true frames without the object")
        depth = frame.depth if truth.metric else None
        references.append(Reference(frame.color, depth, {"mask": mask}, settings, suffix=suffix))
    return references[0], references[1]


def pair_measures(run: MethodRun, truth: StereoTruth, mask: BoolArray) -> list[Measure]:
    """The completed pair as a pair: its disparity, and whether left and right show the same."""
    done = run.completion
    assert isinstance(done, StereoCompletion) and truth.without_left is not None and truth.without_right is not None
    there = disparity_from_depth(truth.without_left.depth, truth.rig)
    mine, true = (run.view(0).color, run.view(1).color), (truth.without_left.color, truth.without_right.color)
    differences = {
        "photometric": left_right_difference(*mine, done.disparity_left, mask),
        "photometric_at_truth": left_right_difference(*mine, there, mask),
        "photometric_truth": left_right_difference(*true, there, mask),
    }
    return [
        *measures_of("whole", "disparity", disparity_errors(done.disparity_left, there)),
        *measures_of("mask", "disparity", disparity_errors(done.disparity_left, there, mask)),
        *measures_of("mask", "disparity", differences),
    ]


def score_right(truth: StereoTruth, run: MethodRun, source: RGBD, settings: ProtocolSettings, variant: str) -> Scored:
    """The right view made from the left, against the true right picture."""
    reference = right_reference(truth, settings)
    view, target = run.view(), RGBD(truth.right, right_depth(truth), truth.rig.right)
    measured = None if variant else source  # a disparity it found itself is no measurement to hold against it
    measures = [
        *view_measures(run, reference),
        *leak_measures(run, target, reference.regions["seen"]),
        *artifact_measures(run, view, reference, "unseen", reference.regions["unseen"], target, measured),
    ]
    if run.method.fills:
        measures += right_disparity(truth, reference, view.depth)
    shown = None if variant else picture_panel(run, reference, source, target)
    return Scored(tuple(measures), variant, shown, None if variant else view)


@lru_cache(maxsize=1)
def right_reference(truth: StereoTruth, settings: ProtocolSettings) -> Reference:
    """The true right picture and what the left camera sees of it, made once for all methods of a case."""
    regions = stereo_regions(truth.disparity_left, truth.disparity_right)
    return Reference(truth.right, right_depth(truth) if truth.metric else None, regions, settings)


def right_disparity(truth: StereoTruth, reference: Reference, depth: Float32Array) -> list[Measure]:
    """bad-1, bad-2 and epe of the synthesised view's depth, as disparity, in every region."""
    if truth.disparity_right is None:
        return []
    mine = disparity_from_depth(depth, truth.rig)
    found: list[Measure] = []
    for name, region in reference.large_regions(None):
        found += measures_of(name, "disparity", disparity_errors(mine, truth.disparity_right, region))
    return found


def right_depth(truth: StereoTruth) -> Float32Array:
    """H x W metres (or nominal units) of the true right view; all missing where its disparity is not known."""
    if truth.disparity_right is None:
        return np.zeros(truth.right.shape[:2], np.float32)
    return depth_from_disparity(truth.disparity_right, truth.rig)
