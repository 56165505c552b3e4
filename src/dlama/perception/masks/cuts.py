"""Pixels on the object and next to it in; the region between them cut where colour or depth steps out (shortest paths).

Each pixel goes to the seed from which the cheapest path leads to it (Bai & Sapiro 2007, geodesic matting).
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.kernels.regions import sweep_distances

COLOR_STEP = 12.0
"""CIELAB units that cost as much as ..."""
DEPTH_STEP = 0.02
"""... this relative step in depth, and as ..."""
LENGTH_PX = 40.0
"""... a path of so many pixels over one colour and depth."""
MOST_SWEEPS = 12


def step_costs(rgbd: RGBD) -> tuple[Float32Array, Float32Array]:
    """Cost of going from each pixel (H x W) to its right neighbour, and to its lower one."""
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
    """H x W: cost of the cheapest path from the seeds, over pixels of `within`; inf where none leads."""
    across, down = (cost.copy() for cost in costs)
    across[:, :-1][~(within[:, :-1] & within[:, 1:])] = np.inf
    down[:-1][~(within[:-1] & within[1:])] = np.inf
    near = np.where(seeds & within, np.float32(0), np.float32(np.inf)).astype(np.float32)
    for _ in range(MOST_SWEEPS):
        if not sweep_distances(across, down, near):
            break
    return near


def closer_to_object(rgbd: RGBD, included: BoolArray, excluded: BoolArray, within: BoolArray) -> BoolArray:
    """H x W, True on pixels of `within` that the cheapest path reaches from `included` sooner than from `excluded`."""
    rows, columns = np.nonzero(within | included | excluded)
    box = slice(max(rows.min() - 1, 0), rows.max() + 2), slice(max(columns.min() - 1, 0), columns.max() + 2)
    costs = step_costs(rgbd)
    cropped = costs[0][box], costs[1][box]
    area = (within | included | excluded)[box]
    here, there = (distances(cropped, seeds[box], area) for seeds in (included, excluded))
    out = np.zeros(within.shape, np.bool_)
    out[box] = within[box] & (here < there)
    return out
