"""Depth to points and back: laws, round trips and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlama.geometry.camera import Camera, StereoRig
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.projection import (
    SMALLEST_DISPARITY,
    depth_from_disparity,
    depth_from_inverse,
    disparity_from_depth,
    inverse_depth,
    lift,
    project,
    project_to_pixels,
    rays,
    round_depth,
)
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from worlds import pose_of


@st.composite
def frames(draw: st.DrawFn) -> RGBD:
    """An RGBD of any small size, lens and pose, with valid, far and missing pixels."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    height, width = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    fx, fy = draw(st.floats(1, 2000)), draw(st.floats(1, 2000))
    cx, cy = draw(st.floats(-20, 20)), draw(st.floats(-20, 20))
    pose = pose_of(rng.normal(size=3) * draw(st.floats(0, 3)), rng.uniform(-10, 10, 3))
    depth = np.exp(rng.uniform(np.log(0.1), np.log(500), (height, width))).astype(np.float32)
    state = rng.integers(0, 6, (height, width))
    depth[state == 0], depth[state == 1] = 0, np.inf
    color = rng.integers(0, 256, (height, width, 3), np.uint8)
    return RGBD(color, depth, Camera(width, height, fx, fy, cx, cy, pose))


@settings(max_examples=150, deadline=None)
@given(frames())
def test_project_undoes_lift(rgbd: RGBD) -> None:
    """Law: every valid pixel's point lands on that pixel's centre (1e-9 px), its z is the depth, to the float32 bit."""
    cloud = lift(rgbd)
    pixels, z = project(cloud.points, rgbd.camera)
    rows, columns = np.nonzero(rgbd.valid)
    np.testing.assert_allclose(pixels, np.stack([columns, rows], 1) + 0.5, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(z.astype(np.float32), rgbd.depth[rgbd.valid])
    np.testing.assert_array_equal(cloud.color, rgbd.color[rgbd.valid])


@settings(max_examples=50, deadline=None)
@given(frames())
def test_lift_is_ray_times_depth_in_the_world(rgbd: RGBD) -> None:
    """Oracle: the definition, written per pixel with 4x4 homogeneous coordinates."""
    directions = rays(rgbd.camera)
    expected = [
        (rgbd.camera.world_from_cam @ [*(directions[row, column] * rgbd.depth[row, column]), 1])[:3]
        for row, column in np.argwhere(rgbd.valid)
    ]
    np.testing.assert_allclose(lift(rgbd).points, np.reshape(expected, (-1, 3)), rtol=1e-12, atol=1e-11)


def test_provenance_of_points() -> None:
    """Law: an RGBD's points are measured with confidence 1; a view's points keep what the view says."""
    camera = Camera.from_fov(3, 1, 90)
    color = np.arange(9, dtype=np.uint8).reshape(1, 3, 3)
    rgbd = RGBD(color, np.array([[1, 2, 0]], np.float32), camera)
    cloud = lift(rgbd)
    assert cloud.origin.tolist() == [Origin.MEASURED] * 2 and cloud.confidence.tolist() == [1, 1]
    view = View(
        camera,
        color,
        np.array([[1, 2, 3]], np.float32),
        hole=np.array([[False, True, False]]),
        hole_type=np.array([[HoleType.NONE, HoleType.SENSOR, HoleType.CRACK]], np.uint8),
        origin=np.array([[Origin.MEASURED, Origin.UNKNOWN, Origin.FILLED]], np.uint8),
        confidence=np.array([[1, 0, 0.25]], np.float32),
    )
    cloud = lift(view)
    assert cloud.origin.tolist() == [Origin.MEASURED, Origin.FILLED]
    assert cloud.confidence.tolist() == [1, 0.25]
    assert cloud.color.tolist() == [[0, 1, 2], [6, 7, 8]]


def test_points_next_to_or_behind_the_camera_have_no_pixel() -> None:
    """Closed form: only z > 0 has coordinates; z is reported in any case."""
    camera = Camera.from_fov(4, 4, 90)
    pixels, z = project(np.array([[0.0, 0, 1], [1, 0, 0], [0, 0, 0], [0, 0, -2]]), camera)
    np.testing.assert_array_equal(pixels[0], [2, 2])
    assert np.isnan(pixels[1:]).all()
    np.testing.assert_array_equal(z, [1, 0, 0, -2])


def rig_of(fx: float = 994.978, baseline_m: float = 0.193001, doffs: float = 0.0) -> StereoRig:
    """A pair at the origin, whose left cx is 0."""
    pose = np.eye(4)
    pose[0, 3] = baseline_m
    return StereoRig(Camera(2, 2, fx, fx, 0, 1), Camera(2, 2, fx, fx, doffs, 1, pose))


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.floats(0.0625, 5000, width=32), min_size=1, max_size=20),
    st.floats(-50, 50),
    st.floats(50, 3000),
    st.floats(0.01, 2),
)
def test_depth_disparity_round_trip(metres: list[float], doffs: float, fx: float, baseline_m: float) -> None:
    """There and back: depth survives as far as one float32 step of the disparity allows."""
    depth = np.array(metres, np.float32)
    rig = rig_of(fx, baseline_m, doffs)
    disparity = disparity_from_depth(depth, rig)
    step = np.spacing(np.maximum(np.abs(disparity), 1)) + SMALLEST_DISPARITY
    allowed = depth.astype(float) ** 2 / (fx * baseline_m) * step * 2 + 1e-6 * depth
    clear = allowed < depth / 4  # farther, one step of disparity is a good part of the depth: nothing to test
    np.testing.assert_array_less(np.abs(depth_from_disparity(disparity, rig) - depth)[clear], allowed[clear])


@pytest.mark.parametrize("doffs", [31.086, -0.1, 7.0])
def test_far_and_missing_there_and_back(doffs: float) -> None:
    """Round trip of the two states without a number: with doffs, far is -doffs and comes back as far."""
    depth = np.array([0, np.nan, np.inf, 3], np.float32)
    disparity = disparity_from_depth(depth, rig_of(doffs=doffs))
    assert disparity[0] == disparity[1] == 0
    assert disparity[2] == np.float32(-doffs)
    np.testing.assert_allclose(depth_from_disparity(disparity, rig_of(doffs=doffs)), [0, 0, np.inf, 3], rtol=1e-6)


def test_without_doffs_far_is_missing() -> None:
    """Closed form: at infinity d = 0, and 0 says missing."""
    assert disparity_from_depth(np.array([np.inf], np.float32), rig_of()).tolist() == [0]


def test_disparities_without_a_point_are_missing() -> None:
    """Oracle: 0, NaN and both infinities are missing, d < -doffs lies behind the cameras; above that d counts."""
    disparity = np.array([0, np.nan, np.inf, -np.inf, -32, -30], np.float32)
    depth = depth_from_disparity(disparity, rig_of(doffs=31.086))
    assert depth[:5].tolist() == [0] * 5
    np.testing.assert_allclose(depth[5], 994.978 * 0.193001 / 1.086, rtol=1e-6)
    assert depth_from_disparity(np.array([-1.0]), rig_of()).tolist() == [0]


def test_a_valid_depth_on_zero_disparity_is_not_lost() -> None:
    """Law: valid depth never turns into 'missing', also where the rig puts it on d = 0 exactly."""
    rig = rig_of(1000.0, 0.5, 100.0)
    disparity = disparity_from_depth(np.array([5.0]), rig)
    assert 0 < disparity[0] <= SMALLEST_DISPARITY
    np.testing.assert_allclose(depth_from_disparity(disparity, rig), 5, rtol=1e-6)


def test_inverse_depth_and_back() -> None:
    """Closed form: 4 m is 0.25 / m and back; far and missing are 0, and 0 is far."""
    depth = np.array([[0, 4, 0.5, np.inf]], np.float32)
    w = inverse_depth(depth)
    np.testing.assert_array_equal(w, [[0, 0.25, 2, 0]])
    np.testing.assert_array_equal(depth_from_inverse(w), [[np.inf, 4, 0.5, np.inf]])
    assert w.dtype == depth_from_inverse(w).dtype == np.float32


def test_pixels_of_points_are_those_they_lie_on() -> None:
    """Closed form: a lens of 10 px, its centre at (4, 3): the middle, the last pixel; just beyond it (the nearest pixel is
    its), behind the camera; just before the first one, and the first one."""
    camera = Camera(8, 6, 10, 10, 4, 3)
    points = np.array([[0, 0, 2], [0.79, 0.59, 2], [0.81, 0, 2], [0, 0, -2], [-0.81, 0, 2], [-0.79, -0.59, 2]])
    row, column, z, inside = project_to_pixels(points.reshape(3, 2, 3), camera)
    np.testing.assert_array_equal(inside, [[True, True], [False, False], [False, True]])
    np.testing.assert_array_equal(row, [[3, 5], [3, 0], [3, 0]])
    np.testing.assert_array_equal(column, [[4, 7], [7, 0], [0, 0]])
    np.testing.assert_allclose(z, [[2, 2], [2, -2], [2, 2]])


def test_rounding_keeps_depth_and_far() -> None:
    """Off by less than 1 part in 100,000; missing and far stay, and rounding again changes nothing. Rounded up it is off by less
    than 2, and never less."""
    depth = np.random.default_rng(0).uniform(0.1, 100, (20, 30)).astype(np.float32)
    depth[0, :3] = 0, np.inf, 1
    found = round_depth(depth)
    assert found.dtype == np.float32 and np.array_equal(found, round_depth(found))
    np.testing.assert_allclose(found, depth, rtol=1e-5)
    assert len(np.unique(found.view(np.uint32) & 127)) == 1
    above = round_depth(depth, up=True)
    assert (above >= depth).all() and np.array_equal(above, round_depth(above, up=True))
    np.testing.assert_allclose(above, depth, rtol=2e-5)
