"""Whether a shadow is more than the ground's own pattern, against closed forms: fields of known levels, and a step."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.perception.shadows.contrast import fine_pattern, has_contrast

SIDE = 160
SHADOW = np.zeros((SIDE, SIDE), np.bool_)
SHADOW[60:110, 40:120] = True
EVERYWHERE = np.ones((SIDE, SIDE), np.bool_)


def ground(pattern: float, step: float) -> RGBD:
    """Fields of 2 x 2 px whose logarithms of level + 4 differ from the mean by -pattern, 0 and pattern, in turn; darker by `step`
    in the shadow."""
    field = (np.mgrid[:SIDE, :SIDE] // 2).sum(0) % 3 - 1
    level = np.log(110.0) + pattern * field - step * SHADOW
    color = np.repeat(np.round(np.exp(level) - 4).clip(0, 255).astype(np.uint8)[..., None], 3, 2)
    return RGBD(color, np.ones((SIDE, SIDE), np.float32), Camera.from_fov(SIDE, SIDE, 60))


@pytest.mark.parametrize("step, expected", [(0.13, False), (0.2, True)])
def test_a_step_against_a_pattern(step: float, expected: bool) -> None:
    """Oracle: -p, 0 and p, as often each, have the standard deviation p sqrt(2/3): .163 of .2."""
    assert has_contrast(ground(0.2, step), SHADOW, EVERYWHERE) is expected


def test_a_fine_pattern_has_no_slow_part() -> None:
    """Oracle: a plane has no fine pattern, inside the picture; a chessboard is its own."""
    rows, columns = np.mgrid[:SIDE, :SIDE].astype(np.float32) / SIDE
    board = np.where((np.mgrid[:SIDE, :SIDE].sum(0) % 2) > 0, 0.1, -0.1).astype(np.float32)
    inner = np.s_[10:-10, 10:-10]
    np.testing.assert_allclose(fine_pattern(rows + 2 * columns, EVERYWHERE)[inner], 0, atol=1e-4)
    np.testing.assert_allclose(fine_pattern(board + rows, EVERYWHERE)[inner], board[inner], atol=0.02)


def test_too_little_to_say_anything() -> None:
    assert has_contrast(ground(0.2, 0.0), SHADOW, np.zeros_like(SHADOW))
