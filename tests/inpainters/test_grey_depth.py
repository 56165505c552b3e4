"""The paper's way with depth: an 8-bit picture of metres, filled by the same means as the colours, apart from them."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Painter
from dlama.inpainters.grey_depth import with_grey_depth
from dlama.inpainters.opencv import telea

NOTHING = FillContext(Law(()))


def slope(hole: np.ndarray) -> View:
    """A view of a ramp from 2 to 14 m under noise, with a hole."""
    rng = np.random.default_rng(0)
    depth = np.tile(np.linspace(2, 14, hole.shape[1], dtype=np.float32), (hole.shape[0], 1))
    color = rng.integers(0, 256, (*hole.shape, 3), np.uint8)
    return View.from_rgbd(RGBD(color, depth, Camera.from_fov(*hole.shape[::-1], 60))).without(hole, HoleType.OBJECT)


def block() -> np.ndarray:
    """A hole in the middle."""
    hole = np.zeros((30, 40), bool)
    hole[10:20, 12:24] = True
    return hole


def test_eight_bit_depth_of_other_fillers_has_the_papers_steps() -> None:
    """Closed form: cut at 10 m, rounded to 10 m / 255, never 0; colour, moves and notes go through."""
    proposed = np.array([[1e-4, 0.03, 0.06, 1.37, 9.99, 12, np.inf]], np.float32)
    view = slope(np.zeros((1, 7), bool))

    def inner(view: View, context: FillContext, seed: int) -> Fill:
        return Fill(view.color, proposed, seed, {"who": "inner"})

    fill = with_grey_depth(inner, 10.0)(view, NOTHING, 4)
    np.testing.assert_allclose(fill.depth / (10 / 255), [[1, 1, 2, 35, 255, 255, 255]], rtol=1e-6)
    assert fill.depth.dtype == np.float32
    assert fill.law_moves == 4 and fill.notes["who"] == "inner" and fill.color is view.color
    assert "rounded" in fill.notes["depth_as"]


def test_telea_by_the_letter_is_opencv_on_two_pictures() -> None:
    """Somebody else's code: cv2.inpaint on the colours, and on round(255 min(d, 10) / 10) with black holes."""
    hole = block()
    view = slope(hole)
    fill = with_grey_depth(telea, 10.0)(view, NOTHING, 0)
    grey = np.round(255 * np.minimum(np.where(hole, 0, view.depth), 10) / 10).astype(np.uint8)
    expected = cv2.inpaint(grey, hole.astype(np.uint8), 3, cv2.INPAINT_TELEA)
    np.testing.assert_allclose(fill.depth, expected * (10 / 255), rtol=1e-6)
    np.testing.assert_array_equal(fill.color, cv2.inpaint(view.color, hole.astype(np.uint8), 3, cv2.INPAINT_TELEA))
    assert fill.notes["depth_as"] == "8-bit picture" and fill.notes["depth_channel_spread"] == 0


def test_a_painter_gets_both_pictures_apart_and_its_channels_are_averaged() -> None:
    """Closed form: a painter that writes 30, 60, 90 into every hole gives level 60 of 255 and a spread of 60 levels; what
    it was shown is the colours, and the grey metres with nothing in the hole."""
    shown: list[np.ndarray] = []

    def paint(picture: np.ndarray, hole: np.ndarray, seed: int) -> np.ndarray:
        shown.append(picture.copy())
        return np.where(hole[..., None], np.array([30, 60, 90], np.uint8), picture)

    def unused(view: View, context: FillContext, seed: int) -> Fill:
        raise AssertionError("its own way with a view is not asked")

    hole = block()
    view = slope(hole)
    fill = with_grey_depth(Painter(paint, unused, lambda: {"model": "m"}), 10.0)(view, NOTHING, 0)
    np.testing.assert_allclose(fill.depth[hole], 60 * 10 / 255, rtol=1e-6)
    assert (fill.color[hole] == (30, 60, 90)).all()
    assert fill.notes["model"] == "m" and fill.notes["depth_channel_spread"] == 60
    grey, color = shown
    assert grey.shape == (*hole.shape, 3) and not grey[hole].any() and grey[~hole].max() == 255
    np.testing.assert_array_equal(color, view.color)
