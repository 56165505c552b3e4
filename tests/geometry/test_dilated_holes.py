"""Holes of a view grow: by brute force, with the types of the nearest; what is given up is empty, the rest untouched."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.rendering import dilate_holes
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View


def a_view(hole_type: np.ndarray) -> View:
    """A measured view with holes of the given types, a frame's number and expected errors."""
    rng = np.random.default_rng(0)
    height, width = hole_type.shape
    color = rng.integers(1, 256, (height, width, 3), np.uint8)
    view = View.from_rgbd(RGBD(color, np.full((height, width), 2, np.float32), Camera.from_fov(width, height, 60)))
    for kind in HoleType:
        view = view.without((hole_type == kind) & (hole_type > 0), kind)
    numbers, errors = np.full((height, width), 3, np.uint16), np.ones((height, width, 2), np.float32)
    return dataclasses.replace(view, frame=numbers, errors=errors)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("radius", [1, 3])
def test_grown_holes_take_the_type_of_the_nearest(seed: int, radius: int) -> None:
    """Brute force (distances within the 3 % of OpenCV's 5 x 5 mask); given-up pixels are empty, all others untouched."""
    rng = np.random.default_rng(seed)
    types = np.where(rng.random((14, 17)) < 0.05, rng.integers(1, len(HoleType), (14, 17)), 0).astype(np.uint8)
    view = a_view(types)
    out, count = dilate_holes(view, radius)
    given_up = out.hole & ~view.hole
    assert count == given_up.sum()
    for name in ("color", "depth", "origin", "confidence", "frame", "errors"):
        np.testing.assert_array_equal(getattr(out, name)[~given_up], getattr(view, name)[~given_up])
        assert not getattr(out, name)[given_up].any()
    np.testing.assert_array_equal(out.hole_type[~given_up], view.hole_type[~given_up])
    rows, columns = np.nonzero(view.hole)
    for row, column in np.ndindex(types.shape):
        away = np.hypot(rows - row, columns - column)
        assert out.hole[row, column] == (away.min() <= radius + 0.5)
        nearest = types[rows, columns][away <= 1.03 * away.min()]
        assert not given_up[row, column] or out.hole_type[row, column] in nearest


def test_nothing_grows_by_nothing() -> None:
    """Law: no hole, or radius 0, gives the view back itself."""
    whole = a_view(np.zeros((5, 6), np.uint8))
    holed = a_view(np.eye(5, 6, dtype=np.uint8))
    assert dilate_holes(whole, 3)[0] is whole
    assert dilate_holes(holed, 0)[0] is holed
    assert (holed.origin[~holed.hole] == Origin.MEASURED).all()
