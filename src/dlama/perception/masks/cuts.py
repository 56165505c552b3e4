"""Seeds on the object and on the background in; the region split between them along colour and depth edges out.

Each pixel takes the label of the seed with the shortest geodesic distance (Bai & Sapiro 2007).
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.kernels.regions import sweep_distances

COLOR_STEP = 12.0
"""CIELAB units with the path cost 1."""
DEPTH_STEP = 0.02
"""Relative depth step with the path cost 1."""
LENGTH_PX = 40.0
"""Path length in px with the cost 1, over one colour and depth."""
MOST_SWEEPS = 12


def step_costs(rgbd: RGBD) -> tuple[Float32Array, Float32Array]:
    """Path cost from each pixel (H x W) to its right neighbour, and to its lower one."""
    smooth = cv2.GaussianBlur(rgbd.color, (0, 0), 0.7)
    lab = cv2.cvtColor(smooth.astype(np.float32) / np.float32(255), cv2.COLOR_RGB2LAB)
    depth = np.log(np.where(rgbd.valid, rgbd.depth, 1)).astype(np.float32)
    costs = []
    for axis in (1, 0):
        color = np.sqrt((np.diff(lab, axis=axis) ** 2).sum(2)) / COLOR_STEP
        both = np.minimum(rgbd.valid, np.roll(rgbd.valid, -1, axis))
        both = both[:, :-1] if axis else both[:-1]
        step = np.where(both, np.minimum(np.abs(np.diff(depth, axis=axis)) / DEPTH_STEP, 5), 1)
        cost = np.full(depth.shape, np.inf, np.float32)
        part = cost[:, :-1] if axis else cost[:-1]
        part[...] = color + step + 1 / LENGTH_PX
        costs.append(cost)
    return costs[0], costs[1]


def distances(costs: tuple[Float32Array, Float32Array], seeds: BoolArray, within: BoolArray) -> Float32Array:
    """H x W geodesic distance from the seeds over pixels of `within`; inf where no path leads."""
    across, down = (cost.copy() for cost in costs)
    across[:, :-1][~(within[:, :-1] & within[:, 1:])] = np.inf
    down[:-1][~(within[:-1] & within[1:])] = np.inf
    near = np.where(seeds & within, np.float32(0), np.float32(np.inf)).astype(np.float32)
    for _ in range(MOST_SWEEPS):
        if not sweep_distances(across, down, near):
            break
    return near


def closer_to_object(rgbd: RGBD, included: BoolArray, excluded: BoolArray, within: BoolArray) -> BoolArray:
    """H x W, True on pixels of `within` that are geodesically closer to `included` than to `excluded`."""
    rows, columns = np.nonzero(within | included | excluded)
    box = slice(max(rows.min() - 1, 0), rows.max() + 2), slice(max(columns.min() - 1, 0), columns.max() + 2)
    costs = step_costs(rgbd)
    cropped = costs[0][box], costs[1][box]
    area = (within | included | excluded)[box]
    here, there = (distances(cropped, seeds[box], area) for seeds in (included, excluded))
    out = np.zeros(within.shape, np.bool_)
    out[box] = within[box] & (here < there)
    return out
