"""Slow literal twin of the far layer: for every target pixel, the source's sky in the same direction."""

from __future__ import annotations

import math

import numpy as np

from dlama.geometry.camera import Camera

BORDER = 1e-6


def sky(
    far: np.ndarray, color: np.ndarray, source: Camera, target: Camera
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """shown (bool), colour (float) and unsure (bool) of the target's pixels; where the camera stands does not matter."""
    shown, unsure = np.zeros(target.hw, bool), np.zeros(target.hw, bool)
    out = np.zeros((*target.hw, 3))
    height, width = far.shape
    for row in range(target.height):
        for column in range(target.width):
            ray = [(column + 0.5 - target.cx) / target.fx, (row + 0.5 - target.cy) / target.fy, 1.0]
            x, y, z = source.world_from_cam[:3, :3].T @ (target.world_from_cam[:3, :3] @ ray)
            if z <= 1e-9:
                continue
            u, v = source.fx * x / z + source.cx, source.fy * y / z + source.cy
            unsure[row, column] = min(abs(u - round(u)), abs(v - round(v))) < BORDER
            if not (0 <= u < width and 0 <= v < height) or not far[int(v), int(u)]:
                continue
            shown[row, column] = True
            left, upper = math.floor(u - 0.5), math.floor(v - 0.5)
            block = np.s_[upper : upper + 2, left : left + 2]
            if left < 0 or upper < 0 or left + 1 >= width or upper + 1 >= height or not far[block].all():
                out[row, column] = color[int(v), int(u)]
                continue
            fu, fv = u - 0.5 - left, v - 0.5 - upper
            weights = np.array([[(1 - fu) * (1 - fv), fu * (1 - fv)], [(1 - fu) * fv, fu * fv]])
            out[row, column] = (weights[..., None] * color[block]).sum((0, 1))
    return shown, out, unsure
