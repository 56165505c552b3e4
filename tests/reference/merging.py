"""Slow literal twin of the merge kernel: what several frames show of one pixel, merged as its docstring says."""

from __future__ import annotations

import math

import numpy as np

from dlama.geometry.camera import Camera


def spread(z: float, noise: tuple[float, float]) -> float:
    """Metres between two depths of one surface."""
    return max(0.005 * z, 3 * math.hypot(noise[0], noise[1] * z * z))


def merged_depth(
    shown: list[float],
    cameras: list[Camera],
    around: list[np.ndarray],
    target: Camera,
    pixel: tuple[int, int],
    noise: tuple[float, float],
) -> float:
    """The depth of one target pixel (row, column): the nearest surface that more frames show than looked through; 0 = none.

    shown: metres each frame shows of the pixel, 0 = nothing. around: each frame's own depth, of a neighbourhood the nearest.
    """
    row, column = pixel
    ray = np.array([(column + 0.5 - target.cx) / target.fx, (row + 0.5 - target.cy) / target.fy, 1.0])
    left = sorted(z for z in shown if z > 0)
    while left:
        if left[0] == math.inf:
            return math.inf
        surface = [z for z in left if z <= left[0] + spread(left[0], noise)]
        weights = [1 / z**2 for z in surface]
        mean = sum(w * z for w, z in zip(weights, surface)) / sum(weights)
        point = (target.world_from_cam @ [*(ray * mean), 1.0])[:3]
        votes = len(surface)
        for z, camera, near in zip(shown, cameras, around):
            if z not in surface:
                votes -= _saw_behind(point, camera, near, noise)
        if votes > 0:
            return mean
        left = left[len(surface) :]
    return 0.0


def _saw_behind(point: np.ndarray, camera: Camera, near: np.ndarray, noise: tuple[float, float]) -> bool:
    x, y, z = (camera.cam_from_world @ [*point, 1.0])[:3]
    if z <= 0:
        return False
    column, row = math.floor(camera.fx * x / z + camera.cx), math.floor(camera.fy * y / z + camera.cy)
    if not (0 <= row < near.shape[0] and 0 <= column < near.shape[1]) or near[row, column] == 0:
        return False
    limit = float(near[row, column])
    return limit == math.inf or z < limit - 2 * spread(limit, noise)
