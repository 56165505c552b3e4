"""Slow literal twin of the visibility law: points in the world, one at a time, and a march along the ray in tiny steps.

In: target and source cameras and depth maps. Out: which pixels break the law; where on its ray a pixel first keeps it.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Camera
from worlds import pixels_of, rays_of

STEP = 1e-4
"""Relative length of a step of the march."""
PART = 2000
"""Steps that are looked at together."""
FARTHEST = 1e5
"""Metres at which the march gives up."""
BORDER = 1e-6
"""Pixels, and share of the depth, within which rounding decides."""


def in_front(
    source: Camera, measured: np.ndarray, points: np.ndarray, tolerant: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """For world points (N x 3): hides a measurement or a far pixel of the source; and: rounding may decide otherwise.

    Tolerance: the larger of 1 mm and 0.1 % of what was measured, none if not `tolerant`.
    """
    x, y, z = pixels_of(source, points)
    inside = (z > 0) & (x >= 0) & (x < source.width) & (y >= 0) & (y < source.height)
    column, row = (np.where(inside, value, 0).astype(int) for value in (x, y))
    limit = np.where(inside, measured[row, column], 0).astype(np.float64)
    finite = np.minimum(limit, FARTHEST)
    least = np.where(limit < np.inf, finite - tolerant * np.maximum(1e-3, 1e-3 * finite), np.inf)
    near_border = np.minimum(abs(x - np.round(x)), abs(y - np.round(y))) < BORDER * np.maximum(1, abs(x) + abs(y))
    unsure = near_border | (abs(z) < BORDER) | (abs(z - least) < BORDER * np.maximum(z, 1))
    return inside & (limit > 0) & (z < least), unsure


def broken(
    camera: Camera, depth: np.ndarray, where: np.ndarray, source: Camera, measured: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """H x W: pixels of `where` whose depth breaks the law of one source; and the pixels on which rounding decides."""
    out, unsure = np.zeros(depth.shape, bool), np.zeros(depth.shape, bool)
    rays, centre = rays_of(camera), camera.world_from_cam[:3, 3]
    for row, column in zip(*np.nonzero(where & (depth > 0) & (depth < np.inf))):
        point = centre + float(depth[row, column]) * rays[row, column]
        hides, on_edge = in_front(source, measured, point[None])
        out[row, column], unsure[row, column] = hides[0], on_edge[0]
    return out, unsure


def march(
    camera: Camera, row: int, column: int, depth: float, source: Camera, measured: np.ndarray
) -> tuple[float, float]:
    """First depth from `depth` outwards, in steps of STEP, that keeps the law; and first that keeps it without tolerance.

    inf where none up to FARTHEST does.
    """
    count = int(np.log(FARTHEST / depth) / STEP)
    centre, ray = camera.world_from_cam[:3, 3], rays_of(camera)[row, column]
    firsts = [np.inf, np.inf]
    for begin in range(0, count, PART):
        steps = depth * np.exp(STEP * np.arange(begin, min(count, begin + PART)))
        points = centre + steps[:, None] * ray
        for n, tolerant in enumerate((True, False)):
            if firsts[n] == np.inf and (lawful := ~in_front(source, measured, points, tolerant)[0]).any():
                firsts[n] = float(steps[lawful.argmax()])
        if firsts[1] < np.inf:  # what keeps it without tolerance keeps it with
            break
    return firsts[0], firsts[1]
