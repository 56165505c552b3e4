"""Which pieces are one object, against the true pixels of closed-form worlds and of generated ones."""

from __future__ import annotations

import numpy as np

from dlama import find_mask
from dlama.geometry.camera import Camera
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.worlds.dataset import world
from worlds import Box, Plane, World, innermost_pixel

CAMERA = Camera.from_fov(320, 240, 70)
GROUND, WALL = Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1))
LEAVES = Box((-0.9, -0.4, 2.6), (-0.02, 1.0, 2.65)), Box((0.02, -0.4, 2.6), (0.9, 1.0, 2.65))
"""Two boxes 4 cm apart, through which the wall shows."""
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


def test_two_things_beside_each_other_stay_two() -> None:
    """Two boxes in two colours, and in one colour a hand's breadth apart."""
    rgbd, shown = painted(World((GROUND, WALL, *LEAVES)), {2: BROWN, 3: GREEN})
    assert iou(find_mask(rgbd, clicks=[innermost_pixel(shown == 2)]).mask, shown == 2) > 0.97
    apart = World((GROUND, WALL, LEAVES[0], Box((0.2, -0.4, 2.6), (1.1, 1.0, 2.65))))
    rgbd, shown = painted(apart, {2: BROWN, 3: BROWN})
    assert iou(find_mask(rgbd, clicks=[innermost_pixel(shown == 2)]).mask, shown == 2) > 0.97


def test_what_stands_before_a_thing_of_another_colour_is_not_that_thing() -> None:
    rgbd, shown = painted(World((GROUND, WALL, STOOL, *BED)), {2: GREEN, 3: BROWN, 4: BROWN})
    assert iou(find_mask(rgbd, clicks=[innermost_pixel(shown == 2)]).mask, shown == 2) > 0.97


def test_a_stool_before_a_bed_of_a_generated_world() -> None:
    """One click finds all of the object and no other: what stays of it would stand before the background that is restored."""
    made, size = world(3009), 256
    seen = made.raycast(made.camera(0, size))
    true = seen.group == made.object_index
    found = find_mask(RGBD(seen.color, seen.depth, made.camera(0, size)), clicks=[innermost_pixel(true)]).mask
    assert iou(found, true) > 0.9


def test_a_box_round_an_object_without_depth() -> None:
    """The picture shows a green box before a grey wall, depth only what is round it: that box (oracle: the world's shapes)."""
    rgbd, shown = painted(World((GROUND, WALL, STOOL)), {2: GREEN})
    true = shown == 2
    rows, columns = np.flatnonzero(true.any(1)), np.flatnonzero(true.any(0))
    box = columns[0] - 6.0, rows[0] - 4.0, len(columns) + 10.0, len(rows) + 8.0
    holed = RGBD(rgbd.color, np.where(true, np.float32(0), rgbd.depth), CAMERA)
    for picture in (rgbd, holed):
        assert iou(find_mask(picture, box=box).mask, true) > 0.9


def test_a_negative_click_in_a_box() -> None:
    """Two boxes in one drawn box, one of them clicked away: the other one (oracle: the world's shapes)."""
    rgbd, shown = painted(World((GROUND, WALL, *LEAVES)), {2: BROWN, 3: GREEN})
    true, other = shown == 2, shown == 3
    rows, columns = np.flatnonzero((true | other).any(1)), np.flatnonzero((true | other).any(0))
    box = float(columns[0]), float(rows[0]), float(len(columns)), float(len(rows))
    found = find_mask(rgbd, box=box, not_clicks=[innermost_pixel(other)]).mask
    assert iou(found, true) > 0.9
