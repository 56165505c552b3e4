"""Colours of guesses drawn towards what is known (oracles: closed forms on pictures of one colour, and what must not change)."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.inpainters.layered.color.low_frequency import (
    LARGEST_SHARE,
    REACH,
    blend_with_low_frequency,
)

HW = (40, 60)
DRIFT = 4
"""Grey levels by which OpenCV's Telea leaves a constant picture: it rounds each pixel from those before it."""
KNOWN, PAINTED = np.array([200, 100, 50], np.uint8), np.array([20, 220, 120], np.uint8)


def view_of(kind: HoleType = HoleType.OUT_OF_VIEW) -> View:
    """One colour at 4 m; the right third is a hole."""
    hole = np.zeros(HW, bool)
    hole[:, 40:] = True
    frame = RGBD(np.tile(KNOWN, (*HW, 1)), np.full(HW, 4, np.float32), Camera.from_fov(60, 40, 60))
    return View.from_rgbd(frame).without(hole, kind)


def painted(view: View) -> np.ndarray:
    """Another colour in the hole."""
    return np.where(view.hole[..., None], PAINTED, view.color).astype(np.uint8)


@pytest.mark.parametrize("nearness", [0.0, 0.6, 0.8, 1.0, 2.0])
def test_a_guess_leans_on_the_known_colour_by_distance(nearness: float) -> None:
    """Closed form: of what is known in one colour, the share grows as 1 - exp(-distance / reach), and fades with nearness:
    full at half the median inverse depth and less, nothing at the median and nearer."""
    view = view_of()
    w = np.where(view.hole, np.float32(0.25 * nearness), np.float32(0.25))
    out = blend_with_low_frequency(view, painted(view), view.hole, w)
    distance = cv2.distanceTransform(view.hole.astype(np.uint8), cv2.DIST_L2, 5)[view.hole]
    share = LARGEST_SHARE * (1 - np.exp(-distance / (REACH * 60))) * np.clip(2 * (1 - nearness), 0, 1)
    expected = PAINTED * (1 - share[:, None]) + KNOWN * share[:, None]
    assert share.max() > 0.2 or nearness >= 1
    assert np.abs(out[view.hole] - expected).max() <= DRIFT
    np.testing.assert_array_equal(out[~view.hole], view.color[~view.hole])


def test_fine_detail_stays_where_colours_are_hedged() -> None:
    """Closed form: stripes one pixel wide, of which a blur leaves nothing, keep their contrast, far from what was seen, too."""
    view = view_of()
    stripes = painted(view)
    stripes[::2, 40:], stripes[1::2, 40:] = 100, 140
    out = blend_with_low_frequency(view, stripes, view.hole, np.zeros(HW, np.float32)).astype(int)
    contrast = (out[1::2] - out[::2])[2:-2, 50:]
    assert np.abs(contrast - 40).max() <= 2 + DRIFT


def test_surfaces_keep_their_borders_and_their_contrast() -> None:
    """Closed form: of a dark and a light surface, with coarse stripes on the dark one, each moves as a whole: the border stays
    one pixel wide and the stripes as far apart as painted; and both lean on what is known, 200, 100, 50."""
    view = view_of()
    color, label = painted(view), np.ones(HW, np.int8)
    color[:20, 40:], label[:20] = 230, 2
    color[20:, 40:50], color[20:, 50:] = 60, 90
    out = blend_with_low_frequency(view, color, view.hole, np.zeros(HW, np.float32), label).astype(int)
    moved = (out - color)[:, 50:]
    assert (np.abs(np.diff(moved[:20, :, 0], axis=0)) <= 2).all() and (
        np.abs(np.diff(moved[20:, :, 0], axis=0)) <= 2
    ).all()
    assert (out[19, 45:, 0] - out[20, 45:, 0] > 40).all()
    assert (np.abs(out[20:, 50] - out[20:, 49] - 30) <= 8).all()
    assert (moved[:20, :, 2] < -40).all() and (moved[20:, :, 0] > 30).all()


@pytest.mark.parametrize("kind", [HoleType.DISOCCLUDED, HoleType.OBJECT, HoleType.CRACK])
def test_only_what_is_out_of_view_is_a_guess(kind: HoleType) -> None:
    """Holes of other types keep their painted colours; so do pixels whose colour was not painted, and a view of which nothing is
    known."""
    view, far = view_of(kind), np.zeros(HW, np.float32)
    color = painted(view)
    np.testing.assert_array_equal(blend_with_low_frequency(view, color, view.hole, far), color)
    beyond = view_of()
    np.testing.assert_array_equal(blend_with_low_frequency(beyond, color, np.zeros(HW, bool), far), color)
    unknown = beyond.without(~beyond.hole, HoleType.OUT_OF_VIEW)
    np.testing.assert_array_equal(blend_with_low_frequency(unknown, color, unknown.hole, far), color)
