"""Cameras of visitors and of contents in; a smooth path through them, and where a visitor is put, out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dlama.apps.viewer.contents import Contents
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.cloud import concatenate
from dlama.geometry.rotations import quaternion_from_rotation, rotation_from_quaternion, slerp

SAVED_WIDTH = 1280
"""Pixels of a saved picture."""


def camera_on_path(cameras: Sequence[Camera], at: float) -> Camera:
    """The camera at `at` (0 .. len - 1) on a path through the cameras: places by a Catmull-Rom spline, turns by slerp.

    The lens is that of the camera before.
    """
    first = int(np.clip(np.floor(at), 0, max(len(cameras) - 2, 0)))
    share = float(np.clip(at - first, 0, 1))
    poses = [cameras[int(np.clip(first + step, 0, len(cameras) - 1))].world_from_cam for step in (-1, 0, 1, 2)]
    pose = np.eye(4)
    pose[:3, 3] = catmull_rom(np.stack([each[:3, 3] for each in poses]), share)
    pose[:3, :3] = slerp(poses[1][:3, :3], poses[2][:3, :3], share)
    return cameras[first].at(pose)


def catmull_rom(points: Float64Array, share: float) -> Float64Array:
    """The point between the second and the third of 4 x 3 points (Catmull and Rom 1974, tension 1/2)."""
    before, start, end, after = points
    linear, quadratic = end - before, 2 * before - 5 * start + 4 * end - after
    cubic = 3 * start - before - 3 * end + after
    return np.asarray((2 * start + linear * share + quadratic * share**2 + cubic * share**3) / 2)


def camera_of(client: Any) -> Camera:
    """The visitor's camera, SAVED_WIDTH pixels wide. viser's axes are ours: x right, y down, z forward."""
    seen = client.camera
    height = max(1, round(SAVED_WIDTH / seen.aspect))
    focal = height / 2 / np.tan(seen.fov / 2)
    pose = np.eye(4)
    pose[:3, :3] = rotation_from_quaternion(np.roll(seen.wxyz, -1))
    pose[:3, 3] = seen.position
    return Camera(SAVED_WIDTH, height, focal, focal, SAVED_WIDTH / 2, height / 2, pose)


def go_to(client: Any, camera: Camera, look_ahead: float) -> None:
    """Put a visitor at a camera, turning about a point `look_ahead` metres before it."""
    pose = camera.world_from_cam
    with client.atomic():
        client.camera.position = pose[:3, 3]
        client.camera.wxyz = wxyz(camera)
        client.camera.look_at = pose[:3, 3] + look_ahead * pose[:3, 2]
        client.camera.up_direction = -pose[:3, 1]
        client.camera.fov = 2 * np.arctan(camera.height / (2 * camera.fy))


def overview(contents: Contents) -> Camera:
    """A camera that looks along z at all points of a cloud without cameras."""
    points = concatenate(list(contents.clouds.values())).points
    low, high = np.percentile(points, (2, 98), axis=0)
    pose = np.eye(4)
    pose[:3, 3] = (low + high) / 2 - (0, 0, float(np.max(high - low)) + 1e-3)
    return Camera.from_fov(512, 512, 60, pose)


def wxyz(camera: Camera) -> np.ndarray:
    """The turn of a camera as viser takes it."""
    return np.roll(quaternion_from_rotation(camera.world_from_cam[:3, :3]), 1)
