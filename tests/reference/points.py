"""Slow literal twin of the points mode: for every target pixel, the nearest of all source points that fall into it."""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Camera
from worlds import pixels_of, points_of

BORDER = 1e-6
"""Pixels; a point nearer than this to a pixel's border may be counted to either side."""


def nearest_points(
    depth: np.ndarray, source: Camera, target: Camera, near: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Planar depth (0 = nothing), flat source index (-1 = nothing) and an `unsure` mask, H x W of the target each."""
    there = (depth > 0) & (depth < np.inf)
    x, y, z = pixels_of(target, points_of(source, np.where(there, depth, 1.0).astype(np.float64)))
    out, index, unsure = np.zeros(target.hw), np.full(target.hw, -1), np.zeros(target.hw, np.bool_)
    for row in range(target.height):
        for column in range(target.width):
            best = np.inf
            for number in np.flatnonzero(there & (z > near)):
                dx, dy = x.flat[number] - column, y.flat[number] - row
                if min(dx, dy) < -BORDER or max(dx, dy) > 1 + BORDER:
                    continue
                unsure[row, column] |= min(dx, dy) < BORDER or max(dx, dy) > 1 - BORDER
                if z.flat[number] < best:
                    best = z.flat[number]
                    out[row, column], index[row, column] = best, number
    return out, index, unsure
