"""What stands out in the picture next to what depth found: surfaces drawn by hand, with the answer each of them must have."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.masks.pieces import Pieces
from dlama.perception.masks.saliency_correction import (
    SalientObject,
    depth_step_at_outline,
    number_surfaces,
    select_surfaces,
)
from dlama.perception.masks.supports import Planes

HW = (100, 120)
WALL, SEAT, TABLE = 1, 2, 3


def area(rows: slice, columns: slice) -> BoolArray:
    out = np.zeros(HW, np.bool_)
    out[rows, columns] = True
    return out


BACK = area(slice(10, 50), slice(30, 60)) & ~area(slice(25, 35), slice(40, 50))
"""A chair's back with a gap, through which the wall shows."""
SEATED = area(slice(50, 75), slice(30, 60))
LEG = area(slice(75, 95), slice(30, 35))
BOARD = area(slice(40, 95), slice(60, 100))
"""A table that touches the chair in the picture."""
CHAIR = BACK | SEATED | LEG


@pytest.fixture(scope="module")
def scene() -> tuple[RGBD, Planes, Pieces]:
    label = np.full(HW, WALL, np.int32)
    for where, number in ((BACK | LEG, -1), (SEATED, SEAT), (BOARD, TABLE)):
        label[where] = number
    depth = np.select([CHAIR, BOARD], [2.0, 1.8], 4.0).astype(np.float32)
    rgbd = RGBD(np.full((*HW, 3), 128, np.uint8), depth, Camera.from_fov(120, 100, 60))
    planes = np.array([[0, 0, 0.25], [0, 0, 0.5], [0, 0, 1 / 1.8]])
    found = Planes((1 / depth).astype(np.float32), planes, label, (0.0, 0.0, 0.0), 0.0)
    free = label != WALL
    parent = np.where(free, 1, 0).astype(np.int32)
    return rgbd, found, Pieces(depth, free, parent, ~free)


def test_a_seat_belongs_and_a_table_does_not(scene: tuple[RGBD, Planes, Pieces]) -> None:
    """Depth took the seat for a support and the table with the chair; the picture shows the chair, its gap, and no leg."""
    rgbd, found, pieces = scene
    part = area(slice(10, 75), slice(30, 60))
    shown = SalientObject(part.astype(np.float32), part, 0.0)
    chosen, agreed = select_surfaces(rgbd, found, pieces, BACK | LEG | BOARD, shown)
    assert (chosen == CHAIR).all()
    assert agreed == pytest.approx((BACK | SEATED).sum() / (CHAIR | part).sum())


def test_surfaces_are_parts_of_planes_that_hang_together(scene: tuple[RGBD, Planes, Pieces]) -> None:
    """The wall in the gap and the wall outside are two; what lies on no plane goes by its piece."""
    _, found, pieces = scene
    number = number_surfaces(found, pieces)
    assert number[30, 45] not in (number[0, 0], number[15, 35])
    assert len({int(number[pixel]) for pixel in [(0, 0), (30, 45), (60, 45), (80, 80), (15, 35)]}) == 5


def test_depth_along_an_outline(scene: tuple[RGBD, Planes, Pieces]) -> None:
    """Against the wall the step is 2 m of 2 m; a part of one surface has none."""
    rgbd = scene[0]
    assert depth_step_at_outline(rgbd, BACK) == pytest.approx(1.0, abs=0.01)
    assert depth_step_at_outline(rgbd, area(slice(60, 80), slice(70, 90))) < 1e-6
