"""OpenCV's filler on depth: closed forms that hold to 16-bit steps of inverse depth; the paper's 8-bit steps. Known colours
spread into all others: closed forms on constant pictures, what is known comes back, ranges."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import inpaint
from dlama.inpainters.opencv import RADIUS, paint, pull_push, spread_small, telea, telea_spread

NOTHING = FillContext(Law(()))
HW = (40, 60)
DRIFT = 8
"""Grey levels by which OpenCV's Telea leaves a constant picture 20 px from what is known: it rounds each pixel from those before
it."""


def with_hole(depth: np.ndarray, hole: np.ndarray, color: np.ndarray | None = None) -> View:
    """A view of the given depth, one colour, with a hole."""
    color = np.full((*depth.shape, 3), (200, 30, 90), np.uint8) if color is None else color
    camera = Camera.from_fov(depth.shape[1], depth.shape[0], 60)
    return View.from_rgbd(RGBD(color, depth.astype(np.float32), camera)).without(hole, HoleType.OBJECT)


def block(height: int = 40, width: int = 60) -> np.ndarray:
    """A hole in the middle."""
    hole = np.zeros((height, width), bool)
    hole[12:28, 20:45] = True
    return hole


STEPS = 3
"""16-bit (colour: 8-bit) steps by which OpenCV's Telea drifts on a constant plane this size."""


@pytest.mark.parametrize("metres", [0.05, 1.37, 499.0])
@pytest.mark.parametrize("nearest", [1.0, 0.4])
def test_a_constant_plane_continues_at_its_depth(metres: float, nearest: float) -> None:
    """Closed form: within a few 16-bit steps, whose full scale is the nearest pixel (here the plane itself, or a pixel at
    0.4 times its depth in a corner, which plays no part in the hole). Colour likewise, in steps of 8 bits."""
    depth = np.full((40, 60), metres)
    depth[0, 0] *= nearest
    filled, _ = inpaint(with_hole(depth, block()), telea, NOTHING)
    step = 1 / (metres * nearest) / 65535
    assert abs(1 / filled.depth[block()].astype(float) - 1 / metres).max() < (STEPS + 0.5) * step
    assert abs(filled.color.astype(int) - (200, 30, 90)).max() <= STEPS


@pytest.mark.parametrize("levels", [(0, 255, (70, 90, 3), np.uint8), (0, 65535, (70, 90), np.uint16)])
def test_parts_of_a_hole_are_filled_as_the_whole(levels: tuple[int, int, tuple[int, ...], type]) -> None:
    """Twin: cv2.inpaint of the whole picture, bit for bit, for parts at all distances from each other and at the border."""
    rng = np.random.default_rng(7)
    picture, hole = rng.integers(*levels), np.zeros((70, 90), np.bool_)
    for _ in range(14):
        row, column, height, width = (int(rng.integers(n)) for n in (70, 90, 12, 12))
        hole[row : row + height, column : column + width] = True
    expected = cv2.inpaint(picture, hole.astype(np.uint8), RADIUS, cv2.INPAINT_TELEA)
    np.testing.assert_array_equal(paint(picture, hole), expected)


def test_filled_depth_stays_between_what_is_known() -> None:
    """Law: diffusion makes nothing nearer than the nearest known pixel, and no NaN; with sky about, far is allowed."""
    rng = np.random.default_rng(0)
    depth = rng.uniform(1, 4, (40, 60))
    depth[:14] = np.inf
    filled, _ = inpaint(with_hole(depth, block()), telea, NOTHING)
    assert (filled.depth >= depth.min() * (1 - 1e-4)).all()


@pytest.mark.parametrize("axis", [0, 1])
def test_a_single_row_or_column_is_filled_from_itself(axis: int) -> None:
    """Law: one colour stays that colour but for Telea's rounding. Twin: cv2.inpaint of three such lines side by side; of one it
    reads memory that it did not set."""
    hw = (1, 40) if axis == 0 else (40, 1)
    rng = np.random.default_rng(0)
    hole, line = rng.random(hw) < 0.5, rng.integers(0, 256, (*hw, 3), np.uint8)
    assert (np.abs(paint(np.full((*hw, 3), 90, np.uint8), hole).astype(int) - 90) <= STEPS).all()
    three = cv2.inpaint(line.repeat(3, axis), hole.repeat(3, axis).view(np.uint8), RADIUS, cv2.INPAINT_TELEA)
    np.testing.assert_array_equal(paint(line, hole), three.take([1], axis))


def known_pixels(hw: tuple[int, int] = HW) -> np.ndarray:
    """Twenty columns at the right are unknown, and three in ten of the rest."""
    known = np.random.default_rng(1).random(hw) > 0.3
    known[:, -20:] = False
    return known


@pytest.mark.parametrize("spread", [pull_push, telea_spread, spread_small])
@pytest.mark.parametrize("hw", [HW, (30, 700)])
def test_one_value_stays_itself(spread, hw):
    """Closed form, also of what is spread in a smaller picture."""
    known = known_pixels(hw)
    color = np.where(known[..., None], np.array([200, 100, 50], np.uint8), np.uint8(0))
    expected = np.broadcast_to(color[known][0], color.shape)
    np.testing.assert_allclose(spread(color, known), expected, atol=DRIFT)


def test_what_is_asked_for_is_what_all_is_there():
    """Law: the pixels of `where` alone are those of the whole, in a picture that is spread smaller, too."""
    for hw in (HW, (30, 700)):
        known = known_pixels(hw)
        color = np.random.default_rng(3).integers(0, 256, (*hw, 3), np.uint8) * known[..., None]
        where = ~known & (np.random.default_rng(4).random(hw) > 0.5)
        np.testing.assert_array_equal(spread_small(color, known, where), spread_small(color, known)[where])


def test_pull_push_keeps_what_is_known_and_stays_between():
    """Laws: known values come back bit for bit; a mean of known values lies within their range."""
    known = known_pixels()
    values = np.random.default_rng(2).integers(90, 160, (*HW, 3)).astype(np.float32) * known[..., None]
    mean = pull_push(values, known)
    np.testing.assert_array_equal(mean[known], values[known])
    assert mean.min() >= 89.9 and mean.max() <= 159.1


@pytest.mark.parametrize("spread", [pull_push, telea_spread, spread_small])
def test_nothing_known_is_no_error(spread):
    """Law: the shape stays, all values are finite."""
    values = np.zeros((*HW, 3), np.float32)
    assert np.isfinite(spread(values, np.zeros(HW, bool))).all()
