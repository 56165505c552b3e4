"""A run's completed view and the truth in; how far its confidence and expected errors can be relied on, as measures, out.

Region `filled`: what was a hole of the method's own view and is comparable. Modality `confidence`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.evaluation.metrics.reliability import by_distance, calibration, sparsification_area
from dlama.evaluation.protocols.methods import Measure, MethodRun
from dlama.evaluation.protocols.scores import Reference
from dlama.geometry.rgbd import Float32Array
from dlama.inpainters.confidence import DEPTH_WITHIN

REGION, MODALITY = "filled", "confidence"


def depth_deviation(z: Float32Array, true_z: Float32Array) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """By how much N depths are off: metres (inf where one of both is far), and as a share of the truth, 0..1 (0: both far)."""
    same_far, finite = np.isinf(z) & np.isinf(true_z), np.isfinite(z) & np.isfinite(true_z)
    off = np.where(finite, np.abs(np.where(finite, z, 1) - np.where(finite, true_z, 1)), np.inf)
    return off, np.where(same_far, 0, np.minimum(off / np.where(finite, true_z, 1), 1))


def reliability_measures(run: MethodRun, reference: Reference, number: int = -1) -> list[Measure]:
    """Of one view of a run; nothing of the baseline that fills nothing, where depth is not known, and of hardly any pixels.

    right, predicted: share that is right, and mean confidence; color_within: levels that count as right; ece; ause_depth,
    ause_color (ordered by expected error), each also by distance from the rim and at random; expected and actual errors of depth
    (m, at most the depth itself) and colour (levels); bin_K_share, bin_K_predicted, bin_K_right: the reliability curve, as shares
    of all filled pixels. What rests on expected errors is left out of a view that has none.
    """
    if not run.method.fills or reference.depth is None:
        return []
    warped, view = run.completion.warped[number], run.view(number)
    where = reference.within(warped.hole & ~view.hole & (reference.depth > 0))
    if where.sum() < reference.settings.smallest_region:
        return []
    clip = np.float32(np.inf if run.clip_m is None else run.clip_m)
    z, true_z = view.depth[where], np.minimum(reference.depth, clip)[where]
    painted = warped.color_hole[where]
    color = reference.match_exposure(view.color)[where].astype(np.float32)
    levels = np.abs(color - reference.color[where]).mean(1) * painted
    off, relative = depth_deviation(z, true_z)
    right = (relative <= DEPTH_WITHIN) & (levels <= reference.color_within)
    predicted = view.confidence[where]
    bins = calibration(predicted, right)
    found = {"right": float(right.mean()), "predicted": float(predicted.mean()), "ece": bins.error}
    found["color_within"] = reference.color_within
    others: dict[str, NDArray[np.floating]] = {
        "_distance": by_distance(warped.hole, warped.color_hole)[where],
        "_random": np.random.default_rng(run.method.seed).random(len(predicted)),
    }
    for name, order in {"": predicted, **others}.items():
        found[f"ause_depth{name}"] = sparsification_area(order, relative)
    judged = view.errors is not None
    if painted.any():
        found["actual_color"] = float(levels[painted].mean())
    if painted.any() and judged:
        expected = view.color_error[where]
        for name, order in {"": -expected, **others}.items():
            found[f"ause_color{name}"] = sparsification_area(order[painted], levels[painted])
        found["expected_color"] = float(expected[painted].mean())
    some = np.isfinite(z)
    if some.any():
        if judged:
            found["expected_depth"] = float(view.depth_error[where][some].mean())
        found["actual_depth"] = float(np.minimum(off[some], z[some]).mean())
    region = REGION + reference.suffix
    return [Measure(region, MODALITY, metric, value) for metric, value in (found | bins.measures).items()]
