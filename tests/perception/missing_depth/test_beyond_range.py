"""Missing depth beyond a sensor's range (oracles: the true depth of a closed-form room; laws)."""

from __future__ import annotations

import numpy as np

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.perception.missing_depth.along_colors import DepthByColor
from dlama.perception.missing_depth.between_readings import move_beyond_range
from dlama.perception.planes import SMOOTH
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(192, 144, 60)
ROOM = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 9), (0, 0, -1)), Box((-0.5, 0.0, 1.6), (0.5, 1.0, 2.2))))
RANGE_M = 4


def test_a_room_goes_on_where_the_range_ends() -> None:
    """Law: what was not seen lies beyond the range, though a table that is nearer touches it; what was measured stays."""
    true = ROOM.rgbd(CAMERA)
    lost = true.depth > RANGE_M
    depth = np.where(lost, np.float32(0), true.depth)
    done = dlama.complete(
        RGBD(true.color, depth, CAMERA, padding=np.zeros(lost.shape, np.bool_)), [CAMERA], filler="layered"
    )
    assert lost.mean() > 0.3 and (done.view.depth[lost] > 0.95 * RANGE_M).all()
    np.testing.assert_array_equal(done.view.depth[~lost], depth[~lost])


def test_a_hole_in_a_near_surface_stays_on_it() -> None:
    """Law: a screen without depth on a wall of 2 m stays there, however far the room is next to it; so does a small hole at the
    end of the range."""
    w = np.full((144, 192), 0.5, np.float32)
    w[:, 150:] = 0.1
    for part in (np.s_[40:90, 30:90], np.s_[10:20, 170:180]):
        missing = np.zeros(w.shape, np.bool_)
        missing[part] = True
        filled = DepthByColor(w, np.full(w.shape, SMOOTH, np.int8), missing)
        assert move_beyond_range(filled, np.where(missing, 0, w).astype(np.float32), missing, missing) is filled


def test_between_readings_depth_is_not_moved() -> None:
    """Law: of a room that a LIDAR read in one pixel of fifty, what is missing between readings stays between them."""
    true = ROOM.rgbd(CAMERA)
    depth = true.depth * (np.random.default_rng(0).random(true.depth.shape) < 0.02)
    done = dlama.complete(
        RGBD(true.color, depth, CAMERA, padding=np.zeros(depth.shape, np.bool_)), [CAMERA], filler="layered"
    )
    assert (np.abs(done.view.depth / true.depth - 1) < 0.05).mean() > 0.95
