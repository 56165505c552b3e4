"""Layers under depth edges (oracles: a box before a wall, what a render opens, the definition)."""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.fusion import add_layer
from dlama.geometry.layers.edge_layers import continue_everywhere, continue_under_edges
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from worlds import rgbd_of

CAMERA = Camera.from_fov(64, 48, 60)
BOX = slice(16, 32), slice(20, 44)


def box_before_a_wall() -> View:
    """A green box at 2 m, a red wall at 4 m."""
    color, depth = np.zeros((48, 64, 3), np.uint8), np.full((48, 64), 4, np.float32)
    color[..., 0], depth[BOX] = 200, 2
    color[BOX] = (0, 200, 0)
    return View.from_rgbd(RGBD(color, depth, CAMERA))


def test_the_wall_continues_under_the_box() -> None:
    """As far as it is reported, a little behind 4 m, in red; nowhere else."""
    layer, added = continue_under_edges(box_before_a_wall(), 3)
    expected = np.zeros((48, 64), bool)
    expected[BOX] = True
    expected[19:29, 23:41] = False
    assert (added == expected).all()
    assert (layer.color[added] == (200, 0, 0)).all() and (np.abs(layer.depth[added] - 4 / 0.98) < 1e-3).all()


def test_what_continues_has_its_own_color_where_three_surfaces_meet() -> None:
    """Definition: depth and colour are of one pixel. Green at 2 m below red at 4 m, right of which is blue at 8 m."""
    color, depth = np.full((48, 64, 3), (200, 0, 0), np.uint8), np.full((48, 64), 4, np.float32)
    color[:, 32:], depth[:, 32:] = (0, 0, 200), 8
    color[24:], depth[24:] = (0, 200, 0), 2
    layer, added = continue_under_edges(View.from_rgbd(RGBD(color, depth, CAMERA)), 1)
    of_red = np.abs(layer.depth - 4 / 0.98) < 1e-3
    assert added[24, 31] and added[23, 31]
    assert (layer.color[added & of_red] == (200, 0, 0)).all() and (layer.color[added & ~of_red] == (0, 0, 200)).all()


def test_it_closes_what_a_small_turn_opens() -> None:
    """A turn that opens 1 px next to the box leaves nothing open there; at home every pixel stays."""
    frame = box_before_a_wall()
    scene = Scene((frame,))
    closed = add_layer(scene, *continue_under_edges(frame, 3))
    turned = orbit(CAMERA, 1.5, 0, 3.0)
    inner = slice(8, 40), slice(8, 56)
    assert render(scene, turned).hole[inner].any() and not render(closed, turned).hole[inner].any()
    assert (render(closed, CAMERA).color == frame.color).all() and (render(closed, CAMERA).depth == frame.depth).all()


def test_nothing_to_continue() -> None:
    """A wall alone, and a view of nothing, come back without a pixel."""
    for metres in (1, 0):
        assert not continue_under_edges(View.from_rgbd(rgbd_of(np.full((8, 8), metres))), 3)[1].any()


def test_what_is_farthest_continues_everywhere() -> None:
    """A little behind itself: the wall within 3 px of it, the box in its middle; a hole as the pixel next to it."""
    view = box_before_a_wall()
    hole = np.zeros((48, 64), bool)
    hole[0, 0] = True
    layer = continue_everywhere(view.without(hole, HoleType.SENSOR), 3)
    middle = np.zeros((48, 64), bool)
    middle[19:29, 23:41] = True
    assert np.allclose(layer.depth * 0.98, np.where(middle, 2, 4)) and not layer.hole.any()
    assert (layer.color[middle] == (0, 200, 0)).all() and (layer.color[~middle] == (200, 0, 0)).all()
    empty = view.without(np.ones((48, 64), bool), HoleType.SENSOR)
    assert continue_everywhere(empty, 3) is empty
