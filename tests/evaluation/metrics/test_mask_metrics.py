"""Agreement of masks; shadows darker by a tenth or more."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.evaluation.metrics.masks import darkened_by_shadow
from dlama.geometry.holes import iou


def square(top: int, left: int, side: int = 20) -> np.ndarray:
    out = np.zeros((60, 60), bool)
    out[top : top + side, left : left + side] = True
    return out


def test_iou_of_shifted_squares() -> None:
    """Half a square off: 200 of 600 pixels."""
    assert iou(square(10, 10), square(10, 20)) == pytest.approx(1 / 3)
    assert iou(square(10, 10), square(10, 10)) == 1 and iou(square(0, 0) & False, square(0, 0) & False) == 0


def test_darkened_pixels() -> None:
    """A fifth less light is a shadow, 6 % less is none; nothing under the mask or right beside it."""
    without = np.full((60, 60, 3), 100, np.uint8)
    color = without.copy()
    color[square(10, 10)] = 80
    color[square(35, 35)] = 94
    mask = square(0, 0, 9)
    found = darkened_by_shadow(color, without, mask)
    assert found[12:28, 12:28].all() and not found[33:].any() and not found[:10].any()
