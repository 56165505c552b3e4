"""A wall 4 m away and a square 2 m away that covers part of it, and a camera moved 0.5 m to its right: all by hand.

64 x 64 pixels, f = 64 px, so the wall shifts by 8 px and the square by 16, whole pixels both, and every region is a set of
rectangles. One colour each; a filler that writes one colour and one depth makes every score a sum on paper.
"""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.inpainters import FILLERS, FillerRecord
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill

SIZE, SHIFT_M = 64, 0.5
WALL_M, SQUARE_M = 4.0, 2.0
WALL, SQUARE, FILLED = 100, 200, 40
FILLED_M = 4.5
SOURCE = Camera(SIZE, SIZE, 64, 64, 32, 32)
_POSE = np.eye(4)
_POSE[0, 3] = SHIFT_M
TARGET = SOURCE.at(_POSE)


def rectangle(columns: tuple[int, int], rows: tuple[int, int] = (0, SIZE)) -> np.ndarray:
    """bool picture, True in the columns and rows [from, to)."""
    out = np.zeros((SIZE, SIZE), bool)
    out[rows[0] : rows[1], columns[0] : columns[1]] = True
    return out


SQUARE_IN_SOURCE = rectangle((16, 48), (16, 48))
SQUARE_IN_TARGET = rectangle((0, 32), (16, 48))
OUT_OF_VIEW = rectangle((56, 64))
DISOCCLUDED = rectangle((32, 40), (16, 48))
"""The wall behind the square, columns 16..48 of the source, is at 8..40 of the target, and covered there up to 32."""
BEHIND_SQUARE = rectangle((8, 40), (16, 48))
"""The same with the square taken away."""


def frame(camera: Camera, square: np.ndarray | None) -> RGBD:
    """The wall, and the square where it is reported to be."""
    where = np.zeros((SIZE, SIZE), bool) if square is None else square
    color = np.where(where[..., None], np.uint8(SQUARE), np.uint8(WALL))
    return RGBD(np.repeat(color, 3, 2), np.where(where, SQUARE_M, WALL_M).astype(np.float32), camera)


def constant(view: View, context: FillContext, seed: int) -> Fill:
    """A filler that always writes one colour and one depth."""
    return Fill(np.full_like(view.color, FILLED), np.full(view.depth.shape, FILLED_M, np.float32))


@pytest.fixture
def constant_filler(monkeypatch: pytest.MonkeyPatch) -> str:
    """Its name, while the test runs."""
    monkeypatch.setitem(FILLERS, "constant", FillerRecord(__name__, "constant"))
    return "constant"


def values(measures) -> dict[tuple[str, str, str], float]:
    """By region, modality and metric; every measure stands there once."""
    found = {(m.region, m.modality, m.metric): m.value for m in measures}
    assert len(found) == len(measures)
    return found
