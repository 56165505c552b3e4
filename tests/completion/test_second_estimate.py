"""Depth estimated again from the painted picture (oracles: a plane in closed form, an estimator whose answer is known)."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import dlama
from dlama.completion import second_estimate as room
from dlama.errors import DepthError
from dlama.geometry.holes import dilate_mask
from dlama.perception.monocular import DEFAULT

SIDE = 128
REACH = room.REACH_PX * SIDE // 512
ROWS, COLUMNS = np.indices((SIDE, SIDE))
PLANE = (0.15 + 0.004 * ROWS).astype(np.float32)
"""Inverse depth of the ground."""
MASK = np.zeros((SIDE, SIDE), np.bool_)
MASK[40:75, 50:75] = True
SEEN = np.random.default_rng(3).integers(60, 190, (SIDE, SIDE, 3), np.uint8)


def photo(estimator: str | None = DEFAULT, next_to: float = 0.6) -> dlama.RGBD:
    """A box before the ground, and depth that gives five pixels of the ground next to it another inverse depth, at first that of
    the box; None: measured."""
    w = np.where(MASK, np.float32(0.6), np.where(dilate_mask(MASK, 5), np.float32(next_to), PLANE))
    estimate = None if estimator is None else {"estimator": estimator}
    return dlama.RGBD(SEEN, 1 / w, dlama.Camera.from_fov(SIDE, SIDE, 60), estimate)


def removed(monkeypatch: pytest.MonkeyPatch, inverse: np.ndarray, next_to: float = 0.6) -> dlama.Completion:
    """The photo without its box, where the second estimate sees that inverse depth."""
    again = SimpleNamespace(depth=(1 / inverse).astype(np.float32))
    monkeypatch.setattr(room, "estimate_depth", lambda color, **_: again)
    return dlama.remove(photo(next_to=next_to), MASK, filler="telea")


@pytest.mark.parametrize("next_to", [0.6, 0.05])
def test_what_ran_out_of_the_object_goes_with_it(monkeypatch: pytest.MonkeyPatch, next_to: float) -> None:
    """Closed form: another scale and shift of the true plane; the plane is there behind the box and next to it, where it was too
    near as where it was too far, and all else is as it was, to the bit."""
    done = removed(monkeypatch, 0.4 * PLANE + 0.05, next_to)
    depth, before = done.view.depth, photo(next_to=next_to).depth
    near = dilate_mask(MASK, 5)
    assert np.abs(before[near & ~MASK] * PLANE[near & ~MASK] - 1).min() > 0.2
    np.testing.assert_allclose(depth[MASK] * PLANE[MASK], 1, atol=0.01)
    inner = dilate_mask(MASK, REACH // 2) & ~MASK
    np.testing.assert_allclose(depth[inner] * PLANE[inner], 1, atol=0.01)
    beyond = ~dilate_mask(MASK, REACH + 4)
    np.testing.assert_array_equal(depth[beyond], before[beyond])
    np.testing.assert_array_equal(done.view.color[beyond], SEEN[beyond])
    assert done.meta["notes"]["depth_estimated_again"]["taken"] and done.meta["law_violations"] == 0


def test_going_on_from_the_scene_sees_the_same_depth(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: the scene of the result shows the result; completing it again changes nothing."""
    done = removed(monkeypatch, 0.4 * PLANE + 0.05)
    monkeypatch.setattr(room, "estimate_depth", lambda color, **_: pytest.fail("nothing was filled"))
    again = dlama.complete(done.scene, [done.view.camera], filler="telea")
    np.testing.assert_allclose(again.view.depth, done.view.depth, rtol=1e-4)


@pytest.mark.parametrize("inverse", [0.9 - PLANE, np.random.default_rng(1).uniform(0.1, 1, (SIDE, SIDE))])
def test_an_estimate_that_differs_is_not_taken(monkeypatch: pytest.MonkeyPatch, inverse: np.ndarray) -> None:
    """Law: what is nearer where the first says farther, or noise, moves no known pixel, and meta says so."""
    done = removed(monkeypatch, inverse)
    known = ~dilate_mask(MASK, 4)
    np.testing.assert_array_equal(done.view.depth[known], photo().depth[known])
    note = done.meta["notes"]["depth_estimated_again"]
    assert not note["taken"] and "differs" in note["reason"]


@pytest.mark.parametrize("estimator", [None, "depth-anything-v2-small", "phone"])
def test_other_depth_is_not_estimated_again(monkeypatch: pytest.MonkeyPatch, estimator: str | None) -> None:
    """Law: measured depth, and what another network or a phone says, stay to the bit, and nothing asks for an estimate."""
    monkeypatch.setattr(room, "estimate_depth", lambda color, **_: pytest.fail("of other depth"))
    rgbd = photo(estimator)
    done = dlama.remove(rgbd, MASK, filler="telea")
    known = ~dilate_mask(MASK, 4)
    np.testing.assert_array_equal(done.view.depth[known], rgbd.depth[known])
    assert "depth_estimated_again" not in done.meta["notes"]


def test_a_picture_without_depth_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: where the network sees nothing but sky nothing can be fitted, and meta says so."""

    def refuse(color: np.ndarray, sharpen: bool) -> None:
        raise DepthError("nothing but sky")

    monkeypatch.setattr(room, "estimate_depth", refuse)
    note = dlama.remove(photo(), MASK, filler="telea").meta["notes"]["depth_estimated_again"]
    assert note == {"taken": False, "reason": "too little is known round the object"}


def test_outliers_do_not_count_in_the_fit() -> None:
    """Closed form: a fifth of the values are of another surface."""
    values = np.linspace(0.1, 0.9, 500).astype(np.float32)
    expected = 2 * values + 0.3
    expected[::5] += 1
    assert room.fit_scale_and_shift(values, expected) == pytest.approx((2, 0.3), abs=0.02)
