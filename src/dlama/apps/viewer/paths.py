"""Cameras in; a smooth path through them out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dlama.datasets.rotations import quaternion_of, rotation_of
from dlama.geometry.camera import Camera, Float64Array


def between(cameras: Sequence[Camera], at: float) -> Camera:
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


def slerp(start: Float64Array, end: Float64Array, share: float) -> Float64Array:
    """The rotation (3 x 3) that lies between two, at a constant angular speed (Shoemake 1985)."""
    one, other = quaternion_of(start), quaternion_of(end)
    cosine = float(one @ other)
    if cosine < 0:  # the same rotation, the short way round
        other, cosine = -other, -cosine
    angle = np.arccos(min(cosine, 1.0))
    if angle < 1e-9:
        return start
    return rotation_of((np.sin((1 - share) * angle) * one + np.sin(share * angle) * other) / np.sin(angle))
