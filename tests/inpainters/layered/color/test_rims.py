"""Colours at the rim of a hole are blended with known ones: as the slow twin does, along ledges, and no farther than it
should."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.layered import filler
from dlama.inpainters.layered.color.rims import blend_at_rim
from dlama.inpainters.layered.kernels.rims import APART, Picture, mean_known

HW = 24, 30


def beside_slowly(color, where, known, label, w, reach, apart):  # type: ignore[no-untyped-def]
    """The literal twin: for each pixel, the weighted mean over a mask of all others."""
    rows, columns = np.indices(where.shape)
    out, found = np.zeros(color.shape), np.zeros(where.shape, bool)
    for y, x in np.argwhere(where):
        square = (rows - y) ** 2 + (columns - x) ** 2
        counts = (square <= reach**2) & (known == label[y, x]) & (np.abs(w - w[y, x]) <= apart * w[y, x])
        if counts.any():
            out[y, x] = np.average(color[counts], axis=0, weights=1 / square[counts] ** 2.0)
            found[y, x] = True
    return out, found


def test_the_kernel_agrees_with_its_slow_twin() -> None:
    rng = np.random.default_rng(0)
    color = rng.integers(0, 256, (*HW, 3), np.uint8)
    label = rng.integers(-1, 3, HW).astype(np.int8)
    w = rng.uniform(0.3, 0.35, HW).astype(np.float32)
    where = rng.random(HW) < 0.4
    known = np.where(where, -2, label).astype(np.int8)
    places = np.flatnonzero(where).astype(np.int32)
    got, found = np.zeros((len(places), 3), np.float32), np.empty(len(places), bool)
    mean_known(0, len(places), Picture(color, known, label, w), places, 3, got, found)
    wanted, there = beside_slowly(color, where, known, label, w, 3, APART)
    np.testing.assert_array_equal(found, there[where])
    np.testing.assert_allclose(got, wanted[where], rtol=1e-5)
    assert found.sum() > 100


def ledge(width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A wall with a ledge, a hole `width` px wide across it, and the wall as painted grey in the hole."""
    truth = np.full((*HW, 3), 200, np.uint8)
    truth[10:14] = 40
    hole = np.zeros(HW, bool)
    hole[:, 10 : 10 + width] = True
    return truth, hole, np.where(hole[..., None], np.uint8(120), truth)


@pytest.mark.parametrize("width", [3, 6])
def test_a_ledge_goes_on_through_a_narrow_hole(width: int) -> None:
    """Oracle: the wall without the hole; what was painted is grey all over. Known pixels stay bit for bit."""
    truth, hole, painted = ledge(width)
    flat = np.full(HW, 0.2, np.float32), np.ones(HW, np.int8), np.zeros(HW, bool)
    out = blend_at_rim(painted, hole, hole, *flat)
    np.testing.assert_array_equal(out[~hole], painted[~hole])
    before, after = (((a.astype(float) - truth)[hole] ** 2).mean() for a in (painted, out))
    assert after < before / 2


def test_other_surfaces_and_what_is_spoiled_or_out_of_view_lend_nothing() -> None:
    """Law: a hole none of whose own surface is known next to it, or that is not asked for, comes back as it was painted."""
    _, hole, painted = ledge(6)
    w, label, nothing = np.full(HW, 0.2, np.float32), np.ones(HW, np.int8), np.zeros(HW, bool)
    for result in (
        blend_at_rim(painted, hole, hole, w, np.where(hole, 2, label).astype(np.int8), nothing),
        blend_at_rim(painted, hole, hole, np.where(hole, np.float32(0.1), w), label, nothing),
        blend_at_rim(painted, hole, hole, w, label, ~hole),
        blend_at_rim(painted, hole, nothing, w, label, nothing),
    ):
        np.testing.assert_array_equal(result, painted)


@pytest.mark.parametrize("kind", [HoleType.DISOCCLUDED, HoleType.OBJECT, HoleType.OUT_OF_VIEW])
def test_beside_a_removed_thing_nothing_is_led_in(kind: HoleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: scraps of its shadow lie there; dis-occlusions are led into, what is out of view is not."""
    picture, hole, _ = ledge(6)
    view = View.from_rgbd(RGBD(picture, np.full(HW, 5, np.float32), Camera.from_fov(HW[1], HW[0], 60))).without(
        hole, kind
    )
    asked = []
    monkeypatch.setattr(filler, "blend_at_rim", lambda color, hole, where, *_: asked.append(where) or color)
    filler.layered(view, FillContext(Law(())))
    np.testing.assert_array_equal(asked[0], hole & (kind == HoleType.DISOCCLUDED))
