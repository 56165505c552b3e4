"""Where a mask ends, against closed forms: colours in a band."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dlama import find_mask
from dlama.geometry.camera import Camera
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import RGBD
from dlama.perception.masks import borders
from dlama.perception.masks.borders import MOST_PX, decide_by_color, run_grabcut
from worlds import Box, Plane, World, innermost_pixel


def test_a_carpet_is_no_part_of_what_stands_on_it() -> None:
    """The true pixels of a box on a layer of 1 cm that continues beyond it."""
    camera = Camera.from_fov(320, 240, 70)
    carpet, box = Box((-1.5, 0.99, 2.0), (0.5, 1.0, 3.6)), Box((-0.3, 0.2, 2.6), (0.1, 0.99, 2.9))
    made = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1)), carpet, box))
    shown = made.trace(camera)[1] == 3
    found = find_mask(made.rgbd(camera), clicks=[innermost_pixel(shown)]).mask
    assert iou(found, shown) > 0.98


def test_a_large_outline_is_decided_in_a_smaller_picture() -> None:
    """Closed form: a disc of one colour on another, 20 px too large in the mask; the rim is found within a pixel of the smaller
    picture, which holds the disc and a fourth of its side round it."""
    y, x = np.ogrid[:1400, :1400]
    away = np.hypot(y - 700, x - 700)
    rng = np.random.default_rng(0)
    color = np.where((away < 500)[..., None], np.uint8(200), np.uint8(60)) + rng.integers(
        0, 20, (1400, 1400, 3), np.uint8
    )
    frame = RGBD(color, np.ones((1400, 1400), np.float32), Camera.from_fov(1400, 1400, 60))
    px = np.sqrt(frame.depth.size / MOST_PX)
    assert px > 2
    found = decide_by_color(frame, away < 520, (away > 470) & (away < 540))
    assert found[away < 500 - px].all() and not found[away > 500 + px].any()


@pytest.mark.parametrize("most", [MOST_PX, 2000])
def test_a_band_round_a_box_is_decided_at_every_size(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """Oracle: the box itself; the picture is smaller than MOST_PX, or larger and made smaller."""
    monkeypatch.setattr(borders, "MOST_PX", most)
    truth, inner, outer = np.zeros((3, 80, 100), bool)
    truth[20:60, 30:70], inner[26:54, 36:64], outer[12:68, 22:78] = True, True, True
    color = np.where(truth[..., None], 200, 60) + np.random.default_rng(0).integers(0, 9, (80, 100, 3))
    frame = RGBD(color.astype(np.uint8), np.ones((80, 100), np.float32), Camera.from_fov(100, 80, 60))
    found = decide_by_color(frame, inner | (outer & (np.arange(100) < 50)), outer & ~inner)
    assert (found & truth).sum() > (0.99 if most == MOST_PX else 0.9) * (found | truth).sum()


def test_an_object_that_a_smaller_picture_loses_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Closed form: the object is a pixel in each tenth row and column, and none is left at a sixth of the size, which OpenCV
    refuses."""
    monkeypatch.setattr(borders, "MOST_PX", 400)
    state = np.full((120, 120), cv2.GC_BGD, np.uint8)
    state[1:60:10, 1:50:10] = cv2.GC_FGD
    found = run_grabcut(np.zeros((120, 120, 3), np.uint8), state, 2)
    np.testing.assert_array_equal(found, state == cv2.GC_FGD)
