"""The sequence protocol (oracles: closed-form frames, a method that knows the answer, counts by hand)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from dlama.evaluation.protocols.methods import ProtocolSettings
from dlama.evaluation.protocols.sequence import (
    SynthesisedView,
    fill_with_telea,
    run_dlama,
    run_z_buffer,
    score_sequence,
    sources_of,
    table,
    visibility_by_count,
)
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from worlds import Box, Plane, World, moved

LENS = Camera.from_fov(64, 48, 60)
WORLD = World((Plane((0, 0, 4), (0.1, 0, -1)), Box((-0.3, -0.6, 2.4), (0.1, 2, 2.6))))
FRAMES = [WORLD.rgbd(moved(LENS, (0, -8 * x, 0), (x, 0, 0))) for x in (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6)]
SETTINGS = ProtocolSettings(lpips=False, smallest_region=5)


def test_sources_come_from_both_sides_and_not_from_beside() -> None:
    """By hand."""
    assert sources_of(3, 4, 7) == [5, 1, 6, 0] and sources_of(0, 2, 7) == [2, 3] and sources_of(3, 8, 7) == [5, 1, 6, 0]


def test_regions_count_the_frames_that_see() -> None:
    """Of two sources: every pixel of known depth is in one of the three, and behind the box fewer see than elsewhere."""
    found = visibility_by_count([FRAMES[1], FRAMES[5]], FRAMES[3], 0.02)
    parts = [found[f"seen by {name}"] for name in ("one", "several", "none")]
    assert (sum(part.astype(int) for part in parts) == 1).all()
    assert found["seen by one"].any() and found["seen by several"].mean() > 0.4


def test_a_method_that_knows_the_truth_is_perfect() -> None:
    """Closed form: SSIM 1, no error, whatever its exposure."""

    def truth(sources: Sequence[RGBD], camera: Camera) -> SynthesisedView:
        rgbd = WORLD.rgbd(camera)
        return SynthesisedView((rgbd.color * 0.8).astype(np.uint8), rgbd.depth, np.zeros(camera.hw, bool))

    rows = list(score_sequence(FRAMES, [3], [str(n) for n in range(7)], SETTINGS, {"truth": truth}, (1, 2)))
    whole = {row.measure.metric: row.measure.value for row in rows if row.measure.region == "whole"}
    assert whole["ssim"] > 0.98 and whole["mse"] < 8 and whole["mae"] == 0 and whole["hole_share"] == 0
    assert {row.frames for row in rows} == {1, 2}


def test_ours_beats_nearest_wins_and_the_table_says_so() -> None:
    """More frames leave fewer holes; depth is better where several see."""
    rows = list(
        score_sequence(FRAMES, [3], [str(n) for n in range(7)], SETTINGS, {"a": run_dlama, "b": run_z_buffer}, (1, 4))
    )

    def value(method: str, frames: int, metric: str) -> float:
        return next(
            row.measure.value
            for row in rows
            if (row.method, row.frames, row.measure.region, row.measure.metric) == (method, frames, "whole", metric)
        )

    assert value("a", 4, "hole_share") < 0.5 * value("a", 1, "hole_share")
    assert value("a", 4, "mae") < value("b", 4, "mae")
    lines = table(rows, "whole").splitlines()
    assert len(lines) == 2 + 4 and lines[2].startswith("| 1 | a | ")


def test_telea_fills_holes_alone() -> None:
    """Law: what is known stays."""
    rgbd = FRAMES[0]
    hole = np.zeros(LENS.hw, bool)
    hole[10:20, 10:20] = True
    made = fill_with_telea(rgbd.color * ~hole[..., None], np.where(hole, 0, rgbd.depth).astype(np.float32), hole)
    np.testing.assert_array_equal(made.color[~hole], rgbd.color[~hole])
    np.testing.assert_array_equal(made.depth[~hole], rgbd.depth[~hole])
    assert made.depth[hole].min() > 0.5 and made.depth[hole] == pytest.approx(rgbd.depth[hole], rel=0.6)
