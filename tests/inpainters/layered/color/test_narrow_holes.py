"""Holes a few pixels wide take the colours round them (oracles: a closed form, the law of what is measured)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.inpainters.layered.color.narrow_holes import close_narrow_holes

ROWS, COLUMNS = np.indices((40, 60))


def ramp_with(hole: np.ndarray, kind: HoleType = HoleType.DISOCCLUDED) -> View:
    """A view of a ramp of 3 levels a column, with that hole (H x W), black in it."""
    ramp = np.repeat((3 * COLUMNS)[..., None], 3, 2).astype(np.uint8)
    camera = Camera.from_fov(60, 40, 60)
    return View.from_rgbd(RGBD(ramp, np.full((40, 60), 2, np.float32), camera)).without(hole, kind)


@pytest.mark.parametrize("width", [1, 2, 3])
def test_a_crack_takes_the_mean_of_both_sides(width: int) -> None:
    """Closed form: a row with one colour on both sides takes it; its depth stays open, and all else is as it was."""
    crack = np.isin(ROWS, range(20, 20 + width)) & (COLUMNS > 10) & (COLUMNS < 50)
    view = ramp_with(crack)
    closed = close_narrow_holes(view)
    assert np.abs(closed.color[..., 0].astype(int) - 3 * COLUMNS)[crack].max() <= 4
    assert not closed.color_hole.any() and (closed.depth_hole == crack).all()
    np.testing.assert_array_equal(closed.color[~crack], view.color[~crack])
    np.testing.assert_array_equal(closed.origin[~crack], view.origin[~crack])


def test_wide_holes_stay_and_lose_their_tails() -> None:
    """Law: a square stays open, a tail of 2 px that leads to it does not."""
    square = (np.abs(ROWS - 20) < 8) & (np.abs(COLUMNS - 20) < 8)
    tail = (np.abs(ROWS - 20) < 2) & (COLUMNS >= 28) & (COLUMNS < 50)
    np.testing.assert_array_equal(close_narrow_holes(ramp_with(square | tail)).color_hole, square)


def test_a_thin_object_stays_removed() -> None:
    """Law: behind a wire that was removed the picture is painted, not closed from its rims."""
    view = ramp_with(np.abs(ROWS - 20) < 2, HoleType.OBJECT)
    assert close_narrow_holes(view) is view
