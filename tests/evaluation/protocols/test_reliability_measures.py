"""Reliability of a run against the truth, and what the report says of it (oracles: the same from view and truth, by hand)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from dlama.datasets.frames import ViewTruth
from dlama.evaluation.metrics.reliability import BINS
from dlama.evaluation.protocols import vpi
from dlama.evaluation.protocols.methods import Measure, Method, MethodRun, ProtocolSettings
from dlama.evaluation.protocols.scores import MODALITY, REGION, reliability_measures
from dlama.evaluation.report.reliability import (
    reliability_lines,
    reliability_tables,
    values_of,
)
from dlama.evaluation.report.summary import Place, Summary, summarise
from dlama.evaluation.runner.store import Row
from dlama.worlds.dataset import world

SETTINGS = ProtocolSettings(lpips=False)


@pytest.fixture(scope="module")
def scored() -> tuple[MethodRun, ViewTruth, dict[str, float]]:
    """A world from 25 degrees further right, filled, its truth, and its measures by name."""
    made = world(900_003)
    truth = ViewTruth(made.frame(made.camera(0, 96)), made.frame(made.camera(25, 96)))
    run = vpi.run_method(Method("dlama", "telea"), truth.source, truth.target.camera)
    measures = reliability_measures(run, vpi.target_reference(truth, SETTINGS))
    assert {(one.region, one.modality) for one in measures} == {(REGION, MODALITY)}
    return run, truth, {one.metric: one.value for one in measures}


def test_right_said_and_errors_by_hand(scored: tuple[MethodRun, ViewTruth, dict[str, float]]) -> None:
    """Oracle: the definition, pixel by pixel, from the completed view and the true frame."""
    run, truth, found = scored
    view, hole = run.view(), run.completion.warped[-1].hole
    right, predicted, levels = [], [], []
    for row, column in np.argwhere(hole & (truth.target.depth > 0)):
        z, true_z = float(view.depth[row, column]), float(truth.target.depth[row, column])
        near = (z == true_z) if np.isinf(true_z) or np.isinf(z) else abs(z - true_z) <= 0.05 * true_z
        off = np.abs(view.color[row, column].astype(float) - truth.target.color[row, column]).mean()
        right.append(near and off <= 25)
        predicted.append(float(view.confidence[row, column]))
        levels.append(off)
    assert found["right"] == pytest.approx(np.mean(right), abs=1e-6)
    assert found["predicted"] == pytest.approx(np.mean(predicted), abs=1e-5)
    assert found["actual_color"] == pytest.approx(np.mean(levels), abs=1e-3)
    assert found["expected_color"] == pytest.approx(view.color_error[hole & (truth.target.depth > 0)].mean(), rel=1e-4)


def test_confidence_orders_better_than_chance(scored: tuple[MethodRun, ViewTruth, dict[str, float]]) -> None:
    """Truth: of a world that was not trained on."""
    found = scored[2]
    for what in ("depth", "color"):
        assert 0 <= found[f"ause_{what}"] < found[f"ause_{what}_random"]


def test_the_baseline_says_nothing(scored: tuple[MethodRun, ViewTruth, dict[str, float]]) -> None:
    """It fills nothing, so there is nothing to rely on; so it is where the truth's depth is not known."""
    run, truth, _ = scored
    reference = vpi.target_reference(truth, SETTINGS)
    assert reliability_measures(MethodRun(Method("dlama", "none"), run.completion, 0.0), reference) == []


def test_a_view_without_expected_errors_is_not_scored_by_them(
    scored: tuple[MethodRun, ViewTruth, dict[str, float]],
) -> None:
    """The published recipe of pairs expects nothing: no error of 0 is reported, and all else is as with them."""
    run, truth, found = scored
    views = tuple(dataclasses.replace(view, errors=None) for view in run.completion.views)
    silent = dataclasses.replace(run, completion=dataclasses.replace(run.completion, views=views))
    measures = reliability_measures(silent, vpi.target_reference(truth, SETTINGS))
    missing = {"expected_depth", "expected_color", "ause_color", "ause_color_distance", "ause_color_random"}
    assert {one.metric: one.value for one in measures} == {k: v for k, v in found.items() if k not in missing}


def summary_of(measures: dict[str, float]) -> Summary:
    """Two frames: the measures, and the same with everything predicted to be wrong."""
    rows = []
    for frame, factor in (("a", 1.0), ("b", 0.0)):
        for name, value in measures.items():
            kept = value * (factor if name.endswith("right") else 1)
            one = Measure(REGION, MODALITY, name, kept)
            rows.append(Row("vpi", "made", frame, frame, 20.0, "dlama", "telea", *one))
    return summarise(rows)


def test_the_report_pools_all_frames(scored: tuple[MethodRun, ViewTruth, dict[str, float]]) -> None:
    """Closed form: the curve is the mean of both frames' bins; the ECE that of the mean, not the mean of both."""
    found = scored[2]
    summary = summary_of(found)
    place = Place(summary, "vpi", "made")
    measured = values_of(place, "dlama/telea")
    assert measured is not None
    values, bins = measured
    np.testing.assert_allclose(bins.right, [found[f"bin_{k}_right"] / 2 for k in range(BINS)])
    assert values["ece"] == pytest.approx(sum(abs(found[f"bin_{k}_predicted"] - bins.right[k]) for k in range(BINS)))
    table, curve = reliability_tables(place, ["dlama/telea"])
    assert len(table.rows) == len(curve.rows) == 1 and len(curve.head) == 1 + BINS
    assert table.rows[0][3].text == f"{values['ece']:.3f}"
    (line,) = reliability_lines(summary)
    assert line.startswith("confidence of dlama/telea, vpi on made: right") and f"ECE {values['ece']:.3f}" in line
