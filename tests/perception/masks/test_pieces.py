"""Which pieces are one object, against the true pixels of closed-form worlds and of generated ones."""

from __future__ import annotations

import numpy as np
import pytest

from dlama import find_mask
from dlama.evaluation.metrics.masks import innermost_pixel, iou
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.worlds.dataset import world
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(320, 240, 70)
GROUND, WALL = Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1))
LEAVES = Box((-0.9, -0.4, 2.6), (-0.02, 1.0, 2.65)), Box((0.02, -0.4, 2.6), (0.9, 1.0, 2.65))
"""A folding screen: two leaves with a crack of 4 cm, through which the wall shows."""
STOOL = Box((-0.4, 0.5, 2.0), (0.4, 1.0, 2.1))
BED = Box((-0.9, 0.8, 2.25), (0.9, 1.0, 3.1)), Box((-0.9, 0.1, 3.0), (0.9, 1.0, 3.1))
"""Only the low end of the bed is near the stool; what shows above it is not."""
BROWN, GREEN = (130, 90, 60), (70, 130, 90)


def painted(world: World, colors: dict[int, tuple[int, int, int]]) -> tuple[RGBD, BoolArray]:
    """The picture with plain colours of shapes (others grey), and which shape each pixel shows."""
    rgbd, shown = world.rgbd(CAMERA), world.trace(CAMERA)[1]
    color = np.full((*shown.shape, 3), 160, np.uint8)
    for number, one in colors.items():
        color[shown == number] = one
    return RGBD(color, rgbd.depth, CAMERA), shown


def test_the_leaves_of_a_screen_are_one_thing() -> None:
    """A crack does not part what has one colour; `part` is the leaf alone."""
    rgbd, shown = painted(World((GROUND, WALL, *LEAVES)), {2: BROWN, 3: BROWN})
    found = find_mask(rgbd, clicks=[innermost_pixel(shown == 2)])
    assert iou(found.mask, (shown == 2) | (shown == 3)) > 0.97
    assert iou(found.candidates["part"], shown == 2) > 0.97


def test_two_things_beside_each_other_stay_two() -> None:
    """The same two boxes in two colours, and in one colour a hand's breadth apart."""
    rgbd, shown = painted(World((GROUND, WALL, *LEAVES)), {2: BROWN, 3: GREEN})
    assert iou(find_mask(rgbd, clicks=[innermost_pixel(shown == 2)]).mask, shown == 2) > 0.97
    apart = World((GROUND, WALL, LEAVES[0], Box((0.2, -0.4, 2.6), (1.1, 1.0, 2.65))))
    rgbd, shown = painted(apart, {2: BROWN, 3: BROWN})
    assert iou(find_mask(rgbd, clicks=[innermost_pixel(shown == 2)]).mask, shown == 2) > 0.97


def test_what_stands_before_a_thing_of_another_colour_is_not_that_thing() -> None:
    rgbd, shown = painted(World((GROUND, WALL, STOOL, *BED)), {2: GREEN, 3: BROWN, 4: BROWN})
    assert iou(find_mask(rgbd, clicks=[innermost_pixel(shown == 2)]).mask, shown == 2) > 0.97


@pytest.mark.parametrize(("seed", "size"), [(3001, 512), (3009, 256)], ids=["folding-screen", "stool-before-bed"])
def test_things_of_generated_worlds(seed: int, size: int) -> None:
    """One click finds all of the object and no other: what stays of it would stand before the background that is restored."""
    made = world(seed)
    seen = made.raycast(made.camera(0, size))
    true = seen.group == made.object_index
    found = find_mask(RGBD(seen.color, seen.depth, made.camera(0, size)), clicks=[innermost_pixel(true)]).mask
    assert iou(found, true) > 0.9


def test_dashes_within_a_ring_belong_to_it() -> None:
    """Spokes seen as dashes, drawn into depth; what lies farther behind, or outside the ring, is no part of it."""
    v, u = np.mgrid[:240, :320]
    away = np.hypot(v - 120, u - 160)
    ring, outside = (away > 70) & (away < 80), (np.abs(v - 120) < 2) & (u > 250) & (u < 260)
    spokes = (np.abs(v - 120) < 3) & (((u - 160) % 17) < 6) & (away < 62)
    behind = np.hypot(v - 150, u - 160) < 6
    color = np.full((240, 320, 3), 160, np.uint8)
    color[ring | spokes | behind | outside] = 40
    depth = np.select([ring | spokes | outside, behind], [2.6, 3.4], 6.0).astype(np.float32)
    found = find_mask(RGBD(color, depth, CAMERA), clicks=[(235, 120)])
    assert (found.mask == (ring | spokes)).all()
    assert iou(found.candidates["part"], ring) > 0.99
