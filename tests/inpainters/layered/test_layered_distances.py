"""Surfaces go on where their colours do, if only depth is missing (oracles: the scene itself; shortest ways by Dijkstra)."""

from __future__ import annotations

import heapq

import numpy as np
import pytest

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.inpainters.layered.kernels.reach import sweep_by_color

WIDTH, HEIGHT = 192, 144
CAMERA = Camera.from_fov(WIDTH, HEIGHT, 60)


def dijkstra(source: np.ndarray, free: np.ndarray, color: np.ndarray, step: float, dearest: float) -> np.ndarray:
    """The slow twin: one queue, every way."""
    distance = np.where(source, 0.0, 1e3)
    queue = [(0.0, *map(int, cell)) for cell in np.argwhere(source)]
    while queue:
        here, row, column = heapq.heappop(queue)
        for dr, dc in ((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b):
            y, x = row + dr, column + dc
            if not (0 <= y < len(free) and 0 <= x < free.shape[1] and free[y, x]):
                continue
            unlike = ((color[y, x] - color[row, column]) ** 2).sum() / step**2
            there = here + np.hypot(dr, dc) * (1 + min(unlike, dearest))
            if there < distance[y, x]:
                distance[y, x] = there
                heapq.heappush(queue, (there, y, x))
    return distance


def test_sweeps_find_the_shortest_ways() -> None:
    """Against Dijkstra, on random colours with walls of cells that are not free."""
    rng = np.random.default_rng(0)
    free = rng.random((18, 23)) < 0.8
    source = np.zeros(free.shape, np.bool_)
    source[4, :3], source[15, 20] = True, True
    free &= ~source
    color = rng.uniform(0, 60, (*free.shape, 3)).astype(np.float32)
    distance = np.where(source, np.float32(0), np.float32(1e3))[None]
    sweep_by_color(0, 1, distance, free, color, 20.0, 20.0, 30)
    np.testing.assert_allclose(distance[0], dijkstra(source, free, color, 20.0, 20.0), rtol=1e-5)


@pytest.mark.parametrize("where", ["strip at the border", "patch over an edge"])
def test_a_table_goes_on_as_far_as_its_colour(where: str) -> None:
    """A Kinect sees no depth in places: table, its edge and the floor below go on there as the colours do."""
    rows, columns = np.indices((HEIGHT, WIDTH))
    floor, table = 1 / (0.1 + 0.005 * (rows + 20)), 1 / (0.55 + 0.004 * rows)
    on_table = (rows > 30) & (rows < 75 - (columns - 100) // 6) & (columns > 130)
    depth = np.where(on_table, table, floor).astype(np.float32)
    grain = np.random.default_rng(0).normal(0, 3, (HEIGHT, WIDTH, 3))
    color = np.where(on_table[..., None], (210, 180, 120), (70, 75, 80)) + grain
    missing = columns >= WIDTH - 40 if "strip" in where else (abs(columns - 139) <= 21) & (rows >= 20) & (rows < 90)
    done = dlama.complete(RGBD(color.astype(np.uint8), np.where(missing, 0, depth), CAMERA), [CAMERA])
    off = np.abs(done.view.depth / depth - 1)[missing]
    assert (off > 0.03).mean() < 0.01
