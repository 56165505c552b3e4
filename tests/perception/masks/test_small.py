"""Masks of large pictures, found in a smaller one (oracles: the true pixels of a closed-form world; laws of the way back)."""

from __future__ import annotations

import numpy as np
import pytest

import dlama
from dlama.errors import MaskError
from dlama.geometry.camera import Camera
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import RGBD
from dlama.perception.masks import small
from dlama.perception.masks.prompt import Prompt
from dlama.perception.masks.small import SmallPicture
from worlds import Box, Plane, World, box_round, innermost_pixel

CAMERA = Camera.from_fov(640, 480, 70)
GROUND, WALL = Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1))
WORLD = World((GROUND, WALL, Box((-0.6, 0.2, 2.6), (0.2, 1.0, 3.2))))


@pytest.fixture
def scene(monkeypatch: pytest.MonkeyPatch) -> tuple[RGBD, np.ndarray]:
    """A picture of 307,200 pixels that counts as large, and which of them show its box."""
    monkeypatch.setattr(small, "LARGEST", 100_000)
    monkeypatch.setattr(small, "SMALL", 30_000)
    return WORLD.rgbd(CAMERA), WORLD.trace(CAMERA)[1] == 2


def test_a_small_picture_is_its_own(scene: tuple[RGBD, np.ndarray], monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: up to LARGEST pixels nothing is shrunk; a larger one has SMALL of them, to a row and a column."""
    found = SmallPicture.of(scene[0])
    assert found is not None and found.rgbd.depth.size == pytest.approx(30_000, rel=0.01)
    monkeypatch.setattr(small, "LARGEST", scene[0].depth.size)
    assert SmallPicture.of(scene[0]) is None


def test_the_outline_is_that_of_the_large_picture(scene: tuple[RGBD, np.ndarray]) -> None:
    """Oracle: the true pixels. The way there and back keeps all but a few of the foot, where depth has no step."""
    picture = SmallPicture.of(scene[0])
    assert picture is not None
    back = picture.enlarge(picture.shrink(scene[1]))
    blocky = small.nearest_pixels(picture.shrink(scene[1]), scene[1].shape)
    assert (back ^ scene[1]).sum() < 0.3 * (blocky ^ scene[1]).sum() and iou(back, scene[1]) > 0.99


def test_a_click_in_a_large_picture(scene: tuple[RGBD, np.ndarray]) -> None:
    """Oracle: the true pixels. Laws: clicks are right to the pixel, also two that share one of the small picture; a click on
    nothing is named by its place in the large one."""
    rgbd, true = scene
    at = innermost_pixel(true)
    assert iou(dlama.find_mask(rgbd, clicks=[at]).mask, true) > 0.97
    beside = at[0] + 1, at[1]
    found = dlama.find_mask(rgbd, clicks=[at], not_clicks=[beside]).mask
    assert found[int(at[1]), int(at[0])] and not found[int(beside[1]), int(beside[0])]
    assert iou(dlama.find_mask(rgbd, box=box_round(true, 6)).mask, true) > 0.97
    with pytest.raises(MaskError, match=r"`?clicks`? holds 600,40,"):
        dlama.find_mask(rgbd, clicks=[(600, 40)])


def test_clicks_at_the_border_stay_in_the_picture(scene: tuple[RGBD, np.ndarray]) -> None:
    """Law: of clicks anywhere in the large picture the small one has a pixel, and of a thin box one, too."""
    picture = SmallPicture.of(scene[0])
    assert picture is not None
    prompt = Prompt((480, 640), ((639.9, 479.9), (0, 0)), ((639.9, 0),), (100, 100, 1, 1))
    smaller = picture.prompt(prompt)
    height, width = picture.rgbd.depth.shape
    assert smaller.on == [(height - 1, width - 1), (0, 0)] and smaller.away == [(0, width - 1)]
    assert smaller.inside.sum() == 1
