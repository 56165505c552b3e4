"""Colours of depth, holes and origins: every code has one, and they mean what the palettes say."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.files.results.preview import hole_legend, percent
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.figures.false_color import (
    HATCH,
    HOLE_PALETTE,
    ORIGIN_PALETTE,
    SKY,
    depth_limits,
    depth_picture,
    hole_picture,
)


def test_palettes_have_a_colour_for_every_code() -> None:
    assert len(HOLE_PALETTE) == len(HoleType) and len(set(HOLE_PALETTE)) == len(HOLE_PALETTE)
    assert len(ORIGIN_PALETTE) == len(Origin) and len(set(ORIGIN_PALETTE)) == len(ORIGIN_PALETTE)


def test_depth_picture_states() -> None:
    """Sky pale, missing and holes hatched, near redder than far (oracle: the first and last colours of turbo)."""
    depth = np.array([[0, np.inf, np.nan, 1, 2, 4, 8]], np.float32)
    hole = np.zeros(depth.shape, bool)
    hole[0, 4] = True
    seen = depth_picture(depth, hole, lo=1, hi=8)
    assert tuple(seen[0, 1]) == SKY
    assert all(tuple(seen[0, i]) in HATCH for i in (0, 2, 4))
    assert seen[0, 3, 0] > 2 * seen[0, 3, 2] and seen[0, 6, 2] > seen[0, 6, 1]
    assert np.array_equal(
        depth_picture(depth, hole, 1, 8)[:, 3:6], depth_picture(depth[:, :6], hole[:, :6], 1, 8)[:, 3:6]
    )


@pytest.mark.parametrize("value", [0, np.inf, 2])
def test_depth_picture_of_one_value(value: float) -> None:
    assert depth_picture(np.full((3, 4), value, np.float32)).shape == (3, 4, 3)
    lo, hi = depth_limits(np.full((3, 4), value, np.float32))
    assert 0 < lo < hi < np.inf


def test_hole_picture_and_legend() -> None:
    color = np.full((10, 10, 3), 77, np.uint8)
    types = np.zeros((10, 10), np.uint8)
    types[:2], types[9, 0] = HoleType.OUT_OF_VIEW, HoleType.OBJECT
    seen = hole_picture(color, types)
    assert (seen[3:9] == 77).all() and tuple(seen[0, 0]) == HOLE_PALETTE[HoleType.OUT_OF_VIEW]
    assert hole_legend(types) == [
        ("out of view 20.0 %", HOLE_PALETTE[HoleType.OUT_OF_VIEW]),
        ("object 1.0 %", HOLE_PALETTE[HoleType.OBJECT]),
    ]
    small, large = np.full((2, 2), HoleType.OBJECT, np.uint8), np.zeros((9, 30), np.uint8)
    assert hole_legend(small, large) == [
        ("object 50.0 %", HOLE_PALETTE[HoleType.OBJECT])
    ]  # as the title, not by pixels
    assert percent(1e-5) == "<0.1 %" and percent(0) == "0.0 %"
