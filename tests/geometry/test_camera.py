"""Camera: there and back of every transform, closed forms of the lens, and what is refused."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlama.errors import CameraError
from dlama.geometry.camera import Camera, StereoRig
from dlama.geometry.motion.poses import FARTHEST_M, check_pose, invert_pose
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.projection import project, px_from_px
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from worlds import pixels_of, points_of, pose_of

numbers = st.floats(-4, 4)
poses = st.builds(pose_of, st.tuples(numbers, numbers, numbers), st.tuples(*[st.floats(-1000, 1000)] * 3))
cameras = st.builds(
    Camera,
    st.integers(1, 50),
    st.integers(1, 50),
    st.floats(1, 3000),
    st.floats(1, 3000),
    st.floats(-50, 100),
    st.floats(-50, 100),
    poses,
)


@settings(max_examples=60, deadline=None)
@given(poses)
def test_pose_there_and_back(pose: np.ndarray) -> None:
    """Law: a motion after its inverse is no motion (1e-9 m over a kilometre), and its inverse's inverse is itself."""
    np.testing.assert_allclose(invert_pose(pose) @ pose, np.eye(4), rtol=0, atol=1e-9)
    np.testing.assert_allclose(invert_pose(invert_pose(pose)), pose, rtol=0, atol=1e-9)
    np.testing.assert_allclose(invert_pose(pose), np.linalg.inv(pose), rtol=0, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(cameras, cameras, st.floats(0.1, 100))
def test_px_from_px_is_the_way_through_the_world(source: Camera, target: Camera, depth: float) -> None:
    """Twin: z * matrix @ (u, v, 1) + offset equals lifting to the world and projecting, written out step by step."""
    matrix, offset = px_from_px(target, source)
    x, y, z = pixels_of(target, points_of(source, np.full(source.hw, depth)))
    u, v = np.meshgrid(np.arange(source.width) + 0.5, np.arange(source.height) + 0.5)
    carried = depth * np.stack([u, v, np.ones_like(u)], -1) @ matrix.T + offset
    ahead = z > 0
    scale = 1e-9 * (1 + np.abs(carried).max())
    np.testing.assert_allclose(carried[..., 2], z, rtol=0, atol=scale)
    np.testing.assert_allclose(carried[ahead][:, 0], (x * z)[ahead], rtol=0, atol=scale)
    np.testing.assert_allclose(carried[ahead][:, 1], (y * z)[ahead], rtol=0, atol=scale)


@settings(max_examples=40, deadline=None)
@given(st.floats(1, 179), st.integers(1, 4000), st.integers(1, 4000))
def test_field_of_view_there_and_back(fov: float, width: int, height: int) -> None:
    """There and back; and square pixels with the principal point in the middle of the picture, not of a pixel."""
    camera = Camera.from_fov(width, height, fov)
    assert camera.fov == pytest.approx(fov, abs=1e-9)
    assert camera.fx == camera.fy
    assert (camera.cx, camera.cy) == (width / 2, height / 2)


def test_ninety_degrees_is_half_the_width() -> None:
    """Closed form: f = (width / 2) / tan 45; sizes and K as they are written."""
    camera = Camera.from_fov(512, 300, 90)
    assert camera.fx == pytest.approx(256)
    assert camera.hw == (300, 512) and camera.wh == (512, 300)
    np.testing.assert_allclose(camera.K, [[256, 0, 256], [0, 256, 150], [0, 0, 1]])


GOOD: dict[str, Any] = {"width": 8, "height": 6, "fx": 5.0, "fy": 5.0, "cx": 4.0, "cy": 3.0}
K = {"width": 8, "height": 6, "pixel_center": 0.5}
REFUSED: list[tuple[Callable[..., object], dict[str, Any], str]] = [
    (Camera, {**GOOD, "width": 0}, "0x6"),
    (Camera, {**GOOD, "height": -1}, "8x-1"),
    (Camera, {**GOOD, "fx": 0.0}, "fx is 0.0"),
    (Camera, {**GOOD, "fy": -2.0}, "fy is -2.0"),
    (Camera, {**GOOD, "fx": np.nan}, "fx is nan"),
    (Camera, {**GOOD, "cy": np.inf}, "cy is inf"),
    (Camera, {**GOOD, "world_from_cam": np.eye(3)}, r"\(3, 3\)"),
    (Camera, {**GOOD, "world_from_cam": np.full((4, 4), np.nan)}, "NaN"),
    (Camera, {**GOOD, "world_from_cam": np.diag([1, 1, -1, 1])}, "mirroring"),
    (Camera, {**GOOD, "world_from_cam": np.diag([2, 2, 2, 1])}, "orthonormal"),
    (Camera, {**GOOD, "world_from_cam": np.ones((4, 4))}, "0 0 0 1"),
    (Camera(**GOOD).cropped, {"x": 0, "y": 0, "width": 0, "height": 5}, "camera size is"),
    (Camera(**GOOD).resized, {"width": 3, "height": -1}, "camera size is"),
    (Camera.from_K, {**K, "K": np.eye(4)}, r"K has shape \(4, 4\)"),
    (Camera.from_K, {**K, "K": [[5, 0.1, 4], [0, 5, 3], [0, 0, 1]]}, "no skew"),
    (Camera.from_K, {**K, "K": [[5, 0, 4], [0, 5, 3], [0, 0, 2]]}, "no skew"),
    (Camera.from_K, {**K, "K": [[-5, 0, 4], [0, 5, 3], [0, 0, 1]]}, "fx is -5"),
    (Camera.from_K, {**K, "K": [[5, 0, np.nan], [0, 5, 3], [0, 0, 1]]}, "cx is nan"),
    (Camera.from_K, {**K, "K": np.eye(3), "pixel_center": 1.0}, "pixel_center is 1; 0.5 or 0.0"),
    (Camera.from_fov, {"width": "64", "height": 48, "fov": 60}, "camera width is '64'"),
    (Camera.from_fov, {"width": 64, "height": None, "fov": 60}, "camera height is None"),
    (Camera.from_fov, {"width": 64, "height": 48, "fov": "60"}, "fov is '60' degrees"),
    *(
        (Camera.from_fov, {"width": 64, "height": 48, "fov": fov}, f"fov is {fov} degrees")
        for fov in (0, 180, -5, np.nan, 1e-9)
    ),
]


@pytest.mark.parametrize(("make", "given", "message"), REFUSED)
def test_what_no_camera_has_is_refused(make: Callable[..., object], given: dict[str, Any], message: str) -> None:
    """Message: a CameraError that names the field and what came; no bare TypeError."""
    with pytest.raises(CameraError, match=message):
        make(**given)


def test_a_rounded_rotation_becomes_an_exact_one() -> None:
    """Law: a published pose of four digits is taken, and comes out orthonormal to 1e-12, no farther off than it was."""
    exact = pose_of((0.3, -1.1, 0.7), (1, 2, 3))
    taken = check_pose(exact.round(4))
    np.testing.assert_allclose(taken[:3, :3].T @ taken[:3, :3], np.eye(3), rtol=0, atol=1e-12)
    np.testing.assert_allclose(taken, exact, rtol=0, atol=2e-4)


def test_a_camera_keeps_its_own_pose() -> None:
    """Law: its pose cannot change, also not through the array it was made from."""
    pose = np.eye(4)
    camera = Camera(**GOOD, world_from_cam=pose)
    pose[0, 3] = 7
    assert camera.world_from_cam[0, 3] == 0
    with pytest.raises(ValueError, match="read-only"):
        camera.world_from_cam[0, 3] = 1


def test_same_view_means_same_lens_and_same_pose() -> None:
    """Law: a shift of a nanometre is the same view, of a micrometre is not; another lens is not."""
    camera = Camera(**GOOD)
    assert camera.same_view_as(camera.at(pose_of((0, 0, 0), (5e-10, 0, 0))))
    assert not camera.same_view_as(camera.at(pose_of((0, 0, 0), (1e-6, 0, 0))))
    assert camera.same_lens_as(camera.at(pose_of((0, 1, 0), (1, 0, 0))))
    assert not camera.same_lens_as(dataclasses.replace(camera, fx=5.1))
    assert not camera.same_view_as(dataclasses.replace(camera, width=9))


points = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(0.1, 50))
sizes = st.integers(1, 60)


@settings(max_examples=60, deadline=None)
@given(cameras, points, st.integers(-20, 60), st.integers(-20, 60), sizes, sizes)
def test_project_then_crop_is_crop_then_project(
    camera: Camera, point: tuple[float, float, float], x: int, y: int, width: int, height: int
) -> None:
    """Law: in the cropped camera every point lands `x` columns and `y` rows earlier; its depth is the same."""
    world = np.array([point]) @ camera.world_from_cam[:3, :3].T + camera.world_from_cam[:3, 3]
    part = camera.cropped(x, y, width, height)
    whole_px, z = project(world, camera)
    part_px, part_z = project(world, part)
    assert part.wh == (width, height)
    np.testing.assert_array_equal(part_z, z)
    np.testing.assert_allclose(part_px, whole_px - (x, y), rtol=0, atol=1e-9 * (1 + np.abs(whole_px).max()))


@settings(max_examples=60, deadline=None)
@given(cameras, points, sizes, sizes)
def test_project_then_scale_is_scale_then_project(
    camera: Camera, point: tuple[float, float, float], width: int, height: int
) -> None:
    """Law: in the resized camera every point lands at the same share of the picture; there and back gives the camera."""
    world = np.array([point]) @ camera.world_from_cam[:3, :3].T + camera.world_from_cam[:3, 3]
    other = camera.resized(width, height)
    whole_px, _ = project(world, camera)
    other_px, _ = project(world, other)
    scale = width / camera.width, height / camera.height
    np.testing.assert_allclose(other_px, whole_px * scale, rtol=1e-9, atol=1e-9 * (1 + np.abs(other_px).max()))
    back = other.resized(*camera.wh)
    np.testing.assert_allclose(back.K, camera.K, rtol=1e-12, atol=1e-9)


def test_from_K_converts_the_pixel_centre() -> None:
    """Closed form: cx = 319.5 of 640 pixels that are counted from 0.0 is the middle, 320; K comes back from the camera."""
    K = [[500, 0, 319.5], [0, 510, 239.5], [0, 0, 1]]
    opencv = Camera.from_K(K, 640, 480, pixel_center=0.0)
    assert (opencv.wh, opencv.fx, opencv.fy, opencv.cx, opencv.cy) == ((640, 480), 500, 510, 320, 240)
    np.testing.assert_array_equal(Camera.from_K(K, 640, 480).K, K)
    posed = Camera.from_K(K, 640, 480, world_from_cam=pose_of((0, 0, 0), (1, 2, 3)))
    np.testing.assert_array_equal(posed.world_from_cam[:3, 3], (1, 2, 3))


@pytest.mark.parametrize("kind", [float, np.uint8, np.int16, np.float32])
def test_a_size_in_any_number_is_one_of_python(kind: Callable[[int], Any]) -> None:
    """Closed form; a float size failed in what was rendered, one of 16 bits overflowed."""
    camera = Camera.from_fov(kind(96), kind(64), 90)
    assert camera.wh == (96, 64) and camera.fx == pytest.approx(48)
    assert type(camera.width) is int and type(camera.height) is int


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.longdouble, np.array, Decimal, Fraction])
def test_intrinsics_in_any_number_are_floats(kind: Callable[[float], Any]) -> None:
    """Oracle: the camera of Python's floats renders the same; kernels had no signature for other numbers, such as a tensor's."""
    pixels = np.full((6, 8, 3), 99, np.uint8), np.full((6, 8), 2, np.float32)
    own = Camera(8, 6, *map(kind, (5.0, 5.0, 4.0, 3.0)))
    assert all(type(getattr(own, name)) is float for name in ("fx", "fy", "cx", "cy"))
    views = [render(RGBD(*pixels, camera), orbit(camera, 5)) for camera in (own, Camera(**GOOD))]
    np.testing.assert_array_equal(views[0].depth, views[1].depth)


def test_cameras_say_what_they_are_in_one_line() -> None:
    """Frozen vectors: f = half the width is 90 degrees; the pose's position; the rig's baseline."""
    left = Camera.from_fov(640, 480, 90)
    assert repr(left) == "Camera(640x480, 90 degrees wide, at (0, 0, 0) m)"
    right = left.at(pose_of((0, 0, 0), (0.125, 0, 0)))
    assert repr(right) == "Camera(640x480, 90 degrees wide, at (0.125, 0, 0) m)"
    assert repr(StereoRig(left, right)) == "StereoRig(640x480, 90 degrees wide, baseline 0.125 m)"


def test_a_pose_as_far_as_may_be_stays_possible_through_rounding() -> None:
    """Law: 1e9 m is allowed, and what rounding adds to that (cos(270 degrees) is -1.8e-16, which is 1e-7 m at this distance)."""
    camera, pose = Camera.from_fov(8, 6, 60), np.eye(4)
    pose[0, 3] = FARTHEST_M * (1 + 2e-16)
    assert camera.at(pose).world_from_cam[0, 3] > FARTHEST_M
    pose[0, 3] = 1.1 * FARTHEST_M
    with pytest.raises(CameraError, match=r"moves by 1\.1e\+09 m; at most 1e\+09 m"):
        camera.at(pose)
