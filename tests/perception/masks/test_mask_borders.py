"""Where a mask ends: how sharp a depth step is (oracle: steps drawn in closed form)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama import find_mask
from dlama.evaluation.metrics.masks import innermost_pixel, iou
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.perception.masks import borders
from dlama.perception.masks.borders import MOST_PX, decide_by_color, edges_are_sharp
from dlama.perception.masks.supports import Planes
from worlds import Box, Plane, World

SIDE = 60


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
@pytest.mark.parametrize("ramp", [1, 9])
def test_a_step_is_sharp_within_one_pixel_at_any_border_of_the_picture(ramp: int, turn: int) -> None:
    """An object that reaches to a border of the picture: what lies at the other border is not next to it."""
    columns = np.arange(SIDE) - 30
    share = np.clip((columns + ramp / 2) / ramp, 0, 1) if ramp > 1 else columns >= 0
    w = np.rot90(np.tile((0.2 + 0.3 * share).astype(np.float32), (SIDE, 1)), turn)
    thing = np.rot90(np.tile(columns >= 0, (SIDE, 1)), turn)
    rgbd = RGBD(np.zeros((SIDE, SIDE, 3), np.uint8), 1 / w, Camera.from_fov(SIDE, SIDE, 60))
    found = Planes(w, np.zeros((0, 3)), np.full(w.shape, -1, np.int32), (), 0.0)
    assert edges_are_sharp(rgbd, found, thing) == (ramp == 1)


def test_a_carpet_is_no_foot_of_what_stands_on_it() -> None:
    """The true pixels of a box on a layer of 1 cm, which rises over the ground as a foot does, but continues beyond it."""
    camera = Camera.from_fov(320, 240, 70)
    carpet, box = Box((-1.5, 0.99, 2.0), (0.5, 1.0, 3.6)), Box((-0.3, 0.2, 2.6), (0.1, 0.99, 2.9))
    made = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1)), carpet, box))
    shown = made.trace(camera)[1] == 3
    found = find_mask(made.rgbd(camera), clicks=[innermost_pixel(shown)]).mask
    assert iou(found, shown) > 0.98


def test_a_large_outline_is_decided_in_a_smaller_picture() -> None:
    """Closed form: a disc of one colour on another, 20 px too large in the mask; the rim is found within 2 px."""
    y, x = np.ogrid[:1400, :1400]
    away = np.hypot(y - 700, x - 700)
    rng = np.random.default_rng(0)
    color = np.where((away < 500)[..., None], np.uint8(200), np.uint8(60)) + rng.integers(
        0, 20, (1400, 1400, 3), np.uint8
    )
    frame = RGBD(color, np.ones((1400, 1400), np.float32), Camera.from_fov(1400, 1400, 60))
    assert frame.depth.size > MOST_PX
    found = decide_by_color(frame, away < 520, (away > 470) & (away < 540))
    assert found[away < 498].all() and not found[away > 502].any()


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
