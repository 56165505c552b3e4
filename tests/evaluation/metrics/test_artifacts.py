"""The paper's artifacts on pictures where each is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from square_world import OUT_OF_VIEW, SIZE, SOURCE, SQUARE_IN_SOURCE, TARGET, frame, rectangle, values

from dlama.evaluation.metrics.artifacts import FARTHEST_EDGE, depth_edges, edge_offset, law_broken, leak_share
from dlama.evaluation.protocols.methods import Method, MethodRun, ProtocolSettings, run_method
from dlama.evaluation.protocols.scores import Reference, artifact_measures
from dlama.geometry.codes import Origin
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View

EVERYWHERE = np.ones((SIZE, SIZE), bool)


def step(column: int, left: float, right: float) -> np.ndarray:
    return np.where(np.arange(SIZE) < column, left, right) * np.ones((SIZE, 1))


def reference_of(truth: RGBD) -> Reference:
    return Reference(truth.color, truth.depth, {}, ProtocolSettings())


def colored(column: int) -> np.ndarray:
    return np.repeat(step(column, 40, 200)[..., None], 3, 2).astype(np.uint8)


def test_depth_edges_stand_on_the_nearer_side() -> None:
    """Closed form: one column of pixels; far counts as a surface behind, missing is no edge, a slope is none."""
    np.testing.assert_array_equal(depth_edges(step(20, 2, 4).astype(np.float32)), rectangle((19, 20)))
    np.testing.assert_array_equal(depth_edges(step(20, np.inf, 4).astype(np.float32)), rectangle((20, 21)))
    assert not depth_edges(step(20, 0, 4).astype(np.float32)).any()
    assert not depth_edges(np.tile(np.linspace(2, 4, SIZE, dtype=np.float32), (SIZE, 1))).any()


@pytest.mark.parametrize("off", [0, 5, 12])
def test_offset_of_edges(off: int) -> None:
    """Closed form: depth parts at column 20, colour `off` columns to the right (Canny is right to a pixel)."""
    depth = step(20, 2, 4).astype(np.float32)
    found = edge_offset(colored(20 + off), depth, EVERYWHERE)
    assert found == pytest.approx(off, abs=1.01)
    assert edge_offset(colored(60), depth, EVERYWHERE) == FARTHEST_EDGE == edge_offset(colored(0), depth, EVERYWHERE)
    assert edge_offset(colored(20), depth, rectangle((30, 64))) is None


def test_leaks_are_counted() -> None:
    """Closed form: a tenth of what is shown in the seen region lies 10 % behind; holes and other regions do not count."""
    truth = frame(SOURCE, None)
    depth = np.array(truth.depth)
    depth[:, :6] *= 1.1
    depth[:, 6:12] *= 1.04
    view = View.from_rgbd(RGBD(truth.color, depth, SOURCE)).without(rectangle((60, 64)), 2)
    assert leak_share(view, truth, EVERYWHERE) == pytest.approx(100 * 6 / 60)
    assert leak_share(view, truth, rectangle((6, 64))) == 0
    assert leak_share(view, truth, EVERYWHERE, clip_m=4.0) == 0
    assert leak_share(view, truth, rectangle((60, 64))) is None


def test_the_law_by_the_uncut_measurements(constant_filler: str) -> None:
    """Closed form: half of what is out of view, put before the square instead, is what breaks the law."""
    source, truth = frame(SOURCE, SQUARE_IN_SOURCE), frame(TARGET, None)
    run = run_method(Method("paper", constant_filler), source, TARGET)
    view = run.view()
    reference = reference_of(truth)
    lawful = values(artifact_measures(run, view, reference, "unseen", OUT_OF_VIEW, truth, source))
    assert lawful["whole", "depth_m", "law_violations"] == lawful["whole", "depth_m", "law_broken"] == 0
    before = rectangle((0, 16), (20, 40))  # of the square's own 32 columns: at 1 m these fall on it or on the wall
    origin = np.where(before, np.uint8(Origin.FILLED), view.origin)
    shining = dataclasses.replace(view, depth=np.where(before, np.float32(1), view.depth), origin=origin)
    filled = int(view.filled.sum()) + int(before.sum())
    assert law_broken(shining, source) == pytest.approx(100 * before.sum() / filled)
    assert law_broken(View.from_rgbd(source), source) is None
    unmeasured = values(artifact_measures(run, view, reference, "unseen", OUT_OF_VIEW, truth, None))
    assert ("whole", "depth_m", "law_violations") in unmeasured and ("whole", "depth_m", "law_broken") not in unmeasured


def test_spread_is_given_where_there_is_one(constant_filler: str) -> None:
    """Law: a three-channel filler's own note becomes a measure; a filler without one has none."""
    source = frame(SOURCE, SQUARE_IN_SOURCE)
    truth = frame(TARGET, None)
    run = run_method(Method("paper", constant_filler), source, TARGET)

    def spreads(one: MethodRun) -> list[float]:
        found = artifact_measures(one, one.view(), reference_of(truth), "unseen", OUT_OF_VIEW, truth, source)
        return [m.value for m in found if m.metric == "channel_spread"]

    assert spreads(run) == []
    noted = dataclasses.replace(run.completion, meta=run.completion.meta | {"notes": {"depth_channel_spread": 1.25}})
    assert spreads(dataclasses.replace(run, completion=noted)) == [1.25]
