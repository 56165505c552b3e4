"""How layers share a picture, where a surface is cut, how large a lone pixel is drawn (oracles: closed forms)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.fusion import fuse, layer_mesh
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from worlds import moved, rgbd_of

CAMERA = Camera.from_fov(24, 16, 60)
RED, GREEN = (255, 0, 0), (0, 255, 0)


def wall(metres: float, color: tuple[int, int, int], camera: Camera = CAMERA, origin: Origin = Origin.MEASURED) -> View:
    """A fronto-parallel wall (or, at inf, sky) in one colour."""
    view = View.from_rgbd(rgbd_of(np.full(camera.hw, metres), camera, color))
    return dataclasses.replace(view, origin=np.full(camera.hw, origin, np.uint8))


@pytest.mark.parametrize(("focal", "ratio"), [(1000, 0.01), (300, 0.02), (50, 0.03)])
def test_a_surface_is_cut_where_inverse_depth_steps(focal: float, ratio: float) -> None:
    """Closed form: 6 px of focal length, 1 % at least and 3 % at most; a step just below is bridged by triangles."""
    camera = Camera(8, 4, focal, focal, 4, 2)
    for step, triangles in ((0.97 * ratio, 2 * 7 * 3), (1.03 * ratio, 2 * 6 * 3)):
        depth = np.full((4, 8), 2, np.float32)
        depth[:, 4:] = 2 / (1 - step)
        assert len(layer_mesh(View.from_rgbd(rgbd_of(depth, camera))).triangles) == triangles


@pytest.mark.parametrize(("nearer", "shown"), [(0.004, RED), (0.006, GREEN)])
def test_of_two_layers_of_one_surface_the_first_stays(nearer: float, shown: tuple[int, int, int]) -> None:
    """Closed form: a later layer covers an earlier one from 0.5 % nearer on; less is the same surface, measured twice."""
    scene = Scene((wall(2, RED),), fills=(wall(2 * (1 - nearer), GREEN),))
    view = render(scene, moved(CAMERA, shift=(0.01, 0, 0)))
    np.testing.assert_array_equal(view.color[4:12, 6:18], np.broadcast_to(np.uint8(shown), (8, 12, 3)))


@pytest.mark.parametrize("home", [2.0, np.inf])
def test_nothing_filled_covers_what_was_measured_at_home(home: float) -> None:
    """Law: in its own camera a measured wall, and measured sky, stay before a filled layer half as far; a measured layer
    covers the wall. From elsewhere the filled layer is seen."""
    next_to = moved(CAMERA, shift=(0, 0, 0.5))
    filled = Scene((wall(home, RED),), fills=(wall(0.5, GREEN, next_to, Origin.FILLED),))
    at_home = render(filled, CAMERA)
    np.testing.assert_array_equal(at_home.depth, home)
    np.testing.assert_array_equal(at_home.color, filled.layers[0].color)
    elsewhere = render(filled, moved(CAMERA, shift=(0.05, 0, 0)))
    np.testing.assert_array_equal(elsewhere.color[6:10, 9:15], np.broadcast_to(np.uint8(GREEN), (4, 6, 3)))
    if home < np.inf:
        measured = render(Scene((wall(home, RED),), fills=(wall(0.5, GREEN, next_to),)), CAMERA)
        np.testing.assert_allclose(measured.depth[6:10, 9:15], 1, rtol=1e-5)


@pytest.mark.parametrize(("origin", "frames"), [(Origin.FILLED, 1), (Origin.FILLED, 2), (Origin.DEPTH_FILLED, 2)])
def test_in_sensor_holes_fills_give_depth_and_colors_stay(origin: Origin, frames: int) -> None:
    """Law: in its own camera a frame's colours stay bit for bit, in sensor holes too, as in a frame added to a completed scene;
    there the nearest of two fills, whose errors of colour do not apply, gives the depth."""
    home, next_to = wall(4, RED), moved(CAMERA, shift=(0.01, 0, 0))
    depth = home.depth.copy()
    depth[4:12, 6:18] = 0
    holed = View.from_rgbd(RGBD(home.color, depth, CAMERA))
    fills = [wall(metres, GREEN, next_to, origin) for metres in (3, 2)]
    errors = np.full((*CAMERA.hw, 2), 9, np.float32)
    scene = Scene(
        (holed, wall(4, RED, next_to))[:frames], fills=tuple(fill.with_planes(errors=errors) for fill in fills)
    )
    view = render(scene, CAMERA)
    np.testing.assert_array_equal(view.color, home.color)
    np.testing.assert_array_equal(view.depth[holed.valid], 4)
    found = view.depth[6:10, 9:15]
    np.testing.assert_allclose(found, 2, rtol=1e-5)
    assert (view.origin[6:10, 9:15] == Origin.DEPTH_FILLED).all()
    assert (view.depth_error[6:10, 9:15] == 9).all() and (view.color_error == 0).all()


def test_a_lone_pixel_is_drawn_as_large_as_it_is_and_32_pixels_at_most() -> None:
    """Closed form: a pixel of 10 m seen from 1 m is 10 x 10 pixels; from 0.2 m it would be 50 x 50, and is 32 x 32."""
    camera = Camera(100, 80, 60, 60, 50.5, 40.5)
    depth = np.zeros(camera.hw, np.float32)
    depth[40, 50] = 10
    view = View.from_rgbd(rgbd_of(depth, camera))
    for distance, side in ((1, 10), (0.2, 32)):
        seen = render(view, moved(camera, shift=(0, 0, 10 - distance)))
        drawn = seen.depth > 0
        assert (drawn.any(0).sum(), drawn.any(1).sum(), drawn.sum()) == (side, side, side * side)


def test_far_pixels_are_fused_once() -> None:
    """Law: a sensor hole that was filled as sky is in the scene already; seen again it adds no layer."""
    depth = np.full(CAMERA.hw, np.inf, np.float32)
    depth[5, 7] = 0
    source = View.from_rgbd(rgbd_of(depth, CAMERA))
    hole = np.zeros(CAMERA.hw, bool)
    origin = np.where(source.hole, np.uint8(Origin.DEPTH_FILLED), source.origin)
    filled = dataclasses.replace(source, depth=np.full_like(depth, np.inf), hole=hole, origin=origin)
    assert filled.hole_type[5, 7] == HoleType.SENSOR
    scene = fuse(Scene((source,)), filled)
    assert len(scene.layers) == 2 and scene.layers[1].far[5, 7]
    assert fuse(scene, filled) is scene
