"""The slow twin of joint upsampling: one pixel after the other, in plain Python."""

from __future__ import annotations

import math

import numpy as np

from dlama.perception.resampling import BEND, COLOR_SIGMA, JUMP, LEAST_NEAR, STEEP

Place = tuple[int, int]


def same_surface(depth: np.ndarray, one: Place, other: Place) -> bool:
    """Whether two neighbours of a map (h x w metres, 0 = missing, inf = far) lie on one surface."""
    first, second = depth[one], depth[other]
    if first == np.inf or second == np.inf:
        return bool(first == second)
    if first <= 0 or second <= 0:
        return False
    step, largest = 1 / second - 1 / first, max(1 / first, 1 / second)
    if abs(step) <= JUMP * largest:
        return True
    towards = other[0] - one[0], other[1] - one[1]
    for end, sign in ((one, -1), (other, 1)):
        beyond = end[0] + sign * towards[0], end[1] + sign * towards[1]
        if not (0 <= beyond[0] < depth.shape[0] and 0 <= beyond[1] < depth.shape[1]):
            continue
        if not 0 < depth[beyond] < np.inf:
            continue
        further = sign * (1 / depth[beyond] - 1 / depth[end])
        if abs(step - further) <= BEND * largest and abs(step) <= STEEP * largest:
            return True
    return False


def upsample(depth: np.ndarray, color: np.ndarray, small_color: np.ndarray) -> np.ndarray:
    """H x W metres of a map (h x w), guided by its picture (H x W x 3) and that at the map's size (h x w x 3)."""
    (rows, columns), (height, width) = depth.shape, color.shape[:2]
    out = np.zeros((height, width))
    for row in range(height):
        for column in range(width):
            y, x = (row + 0.5) * rows / height - 0.5, (column + 0.5) * columns / width - 0.5
            top, left = min(max(math.floor(y), 0), rows - 2), min(max(math.floor(x), 0), columns - 2)
            down, across = min(max(y - top, 0), 1), min(max(x - left, 0), 1)
            near = {
                (top + i, left + j): (down if i else 1 - down) * (across if j else 1 - across)
                for i in (0, 1)
                for j in (0, 1)
            }
            if depth[max(near, key=lambda place: near[place])] <= 0:
                continue
            score = {}
            for place, weight in near.items():
                apart = ((color[row, column].astype(float) - small_color[place]) ** 2).sum()
                score[place] = (weight + LEAST_NEAR) * (
                    math.exp(-min(apart, 40 * COLOR_SIGMA**2) / (6 * COLOR_SIGMA**2)) + 1e-3
                )
            own = max((place for place in near if depth[place] > 0), key=lambda place: score[place])
            if depth[own] == np.inf:
                out[row, column] = np.inf
                continue
            surface = {own}
            for _ in range(3):
                surface |= {
                    place
                    for place in near
                    for member in surface
                    if abs(place[0] - member[0]) + abs(place[1] - member[1]) == 1
                    and same_surface(depth, min(place, member), max(place, member))
                }
            weights = sum(near[place] for place in surface)
            mean = sum(near[place] / depth[place] for place in surface) / weights if weights > 1e-3 else 1 / depth[own]
            out[row, column] = 1 / mean
    return out
