"""The protocol `sequence` of a data set, with removals (oracles: closed-form worlds with and without a ball, counts by hand)."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from dlama.datasets.frames import Case, Dataset, Frame, RemovalTruth
from dlama.errors import InputError
from dlama.evaluation.protocols.methods import ProtocolSettings
from dlama.evaluation.protocols.sequence_removal import removal_table, score_removal
from dlama.evaluation.protocols.sequence_run import held_out_places, rows_of, sort_along_orbit, source_distance
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from worlds import Box, Plane, Sphere, World, moved

LENS = Camera.from_fov(64, 48, 60)
BEHIND = (Plane((0, 0, 4), (0.1, 0, -1)), Box((-1.2, -0.6, 2.8), (-1.0, 2, 3.0)))
WITH, WITHOUT = World((*BEHIND, Sphere((0.1, 0.2, 2.4), 0.3))), World(BEHIND)
YAWS = (0.0, 10.0, -10.0, 20.0)
SETTINGS = ProtocolSettings(lpips=False, smallest_region=5)


def camera(yaw: float) -> Camera:
    return moved(LENS, (0, -yaw, 0), (yaw / 20, 0, 0))


def frame(yaw: float) -> RGBD:
    return WITH.rgbd(camera(yaw))


def removal(yaw: float) -> RemovalTruth:
    return RemovalTruth(frame(yaw), WITHOUT.rgbd(camera(yaw)), WITH.trace(camera(yaw))[1] == 2)


FRAMES = tuple(Frame("room", f"yaw{yaw:g}", partial(frame, yaw), yaw) for yaw in YAWS)
CASES = tuple(Case("ori", "made", "room", f"yaw{yaw:g}", partial(removal, yaw), yaw) for yaw in YAWS)
DATASET = Dataset("made", "made", None, FRAMES, CASES)


def test_which_frames_are_held_out() -> None:
    """By hand: along the orbit, evenly, neighbours as sources where there are few frames."""
    assert [one.yaw for one in sort_along_orbit(FRAMES)] == [-10, 0, 10, 20]
    assert (
        held_out_places(10, 2) == [2, 7] and held_out_places(3, 9) == [0, 1, 2] and len(held_out_places(100, None)) == 5
    )
    assert source_distance(FRAMES) == 1 and source_distance(FRAMES * 10) == 2


def test_rows_of_a_data_set() -> None:
    """Held-out frames and the removal of its scene; each part is told before it begins."""
    told: list[str] = []
    rows = list(rows_of(DATASET, 1, SETTINGS, lambda done, total, name: told.append(f"{done}/{total} {name}")))
    assert told == ["0/2 yaw10", "1/2 room, removal"]
    assert {row.frames for row in rows} == {1, 2, 4} and {row.held_out for row in rows} == {"yaw10", "room"}
    with pytest.raises(InputError, match="no scene of it has 3 posed frames"):
        list(rows_of(Dataset("made", "made", None, FRAMES[:1], ()), 1, SETTINGS, lambda *_: None))


def test_removal_is_held_against_the_world_without_the_thing() -> None:
    """More frames leave less to fill, depth behind the ball is true, and filled points agree (2 levels, 0.1 %)."""
    rows = list(score_removal([removal(yaw) for yaw in YAWS], "room", SETTINGS))

    def value(frames: int, method: str, metric: str) -> float:
        return next(
            row.measure.value
            for row in rows
            if (row.frames, row.method, row.measure.metric) == (frames, method, metric)
        )

    assert value(1, "one mask", "filled") == 100 and value(4, "all masks", "filled") < 50
    assert value(4, "all masks", "absrel") < 0.01
    two = [row.measure for row in rows if row.frames == 2 and row.method == "all masks"]
    agreed = {one.metric: one.value for one in two if one.metric.endswith("agrees")}
    assert not agreed or (agreed["color_agrees"] <= 2 and agreed["depth_agrees"] <= 0.1)
    lines = removal_table(rows).splitlines()
    assert len(lines) == 2 + 5 and lines[2].startswith("| 1 | one mask | 100 | ")
    assert np.isfinite([row.measure.value for row in rows]).all()
