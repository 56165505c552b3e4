"""Surfaces continue where their colours do, if only depth is missing (oracles: the scene itself; shortest ways by Dijkstra; the
minimum as numpy solves for it)."""

from __future__ import annotations

import heapq

import numpy as np
import pytest

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.kernels.along_colors import DEAREST, STEP, DepthCost, nearest_by_color
from dlama.geometry.rgbd import RGBD
from dlama.perception.kernels.relaxation import JUMP, POWER, SOFT, conductances, relax
from dlama.perception.missing_depth import fill_along_colors, relax_depth
from dlama.perception.planes import SKY, SMOOTH, KnownSurfaces

WIDTH, HEIGHT = 192, 144
CAMERA = Camera.from_fov(WIDTH, HEIGHT, 60)


def dijkstra(source: tuple[int, int], free: np.ndarray, color: np.ndarray) -> np.ndarray:
    """The slow twin: one known pixel, one queue, every way."""
    distance = np.full(free.shape, np.inf)
    distance[source] = 0
    queue = [(0.0, *source)]
    while queue:
        here, row, column = heapq.heappop(queue)
        for dr, dc in ((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b):
            y, x = row + dr, column + dc
            if not (0 <= y < len(free) and 0 <= x < free.shape[1] and free[y, x]):
                continue
            unlike = [
                min(((color[y, x] - color[one]) ** 2).sum() / STEP**2, DEAREST) for one in ((row, column), source)
            ]
            there = here + np.hypot(dr, dc) * (1 + sum(unlike))
            if there < distance[y, x]:
                distance[y, x] = there
                heapq.heappush(queue, (there, y, x))
    return distance


@pytest.mark.parametrize("known", [[(4, 2)], [(4, 2), (15, 20), (9, 11)]])
def test_sweeps_find_the_shortest_ways(known: list[tuple[int, int]]) -> None:
    """Against Dijkstra, on random colours with walls: no way is shorter than the shortest; from one known pixel all are as short.

    From several a pixel takes one of those its neighbours took, and a few ways are longer.
    """
    rng = np.random.default_rng(0)
    free = rng.random((18, 23)) < 0.8
    color = rng.uniform(0, 60, (*free.shape, 3)).astype(np.float32)
    source, distance = np.full(free.shape, -1, np.int32), np.full(free.shape, 1e6, np.float32)
    for one in known:
        free[one], source[one], distance[one] = False, np.ravel_multi_index(one, free.shape), 0
    nearest_by_color(distance, source, free, color, DepthCost(np.zeros_like(distance), 0.0, 0.0), 30)
    each = {int(np.ravel_multi_index(one, free.shape)): dijkstra(one, free, color) for one in known}
    shortest = np.minimum.reduce(list(each.values()))
    there = free & np.isfinite(shortest)
    assert ((source >= 0) == (there | (distance == 0))).all()
    assert (distance[there] > shortest[there] * (1 - 1e-5)).all()
    assert np.isclose(distance[there], shortest[there], rtol=1e-4).mean() >= (1 if len(known) == 1 else 0.8)
    for one, own in each.items():
        assert (distance[there & (source == one)] > own[there & (source == one)] * (1 - 1e-5)).all()


def test_what_lies_on_no_plane_is_relaxed_to_the_minimum() -> None:
    """Against the linear system of the same sum of squares, solved by numpy; values of 0 do not count."""
    rng = np.random.default_rng(1)
    shape = (7, 9)
    begin = rng.uniform(0.5, 1, shape).astype(np.float32)
    begin[0, :4] = 0
    color = rng.uniform(0, 8, (*shape, 3)).astype(np.float32)
    free = rng.random(shape) < 0.5
    free &= begin > 0
    values = begin.copy()
    across, down = np.empty((2, *shape), np.float32)
    conductances(0, shape[0], across, down, np.ones(shape, np.bool_), begin, color)
    starts = np.concatenate([[0], free.sum(1).cumsum()])
    relax(across, down, starts, np.flatnonzero(free) % shape[1], np.float32(0.05), begin, values, np.empty(400))
    index = {tuple(map(int, one)): n for n, one in enumerate(np.argwhere(free))}
    matrix, right = np.zeros((len(index),) * 2), np.zeros(len(index))
    for (y, x), n in index.items():
        matrix[n, n], right[n] = 0.05, 0.05 * begin[y, x]
        for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
            if not (0 <= v < shape[0] and 0 <= u < shape[1]) or begin[v, u] == 0:
                continue
            by_color = (1 + ((color[y, x] - color[v, u]) ** 2).sum() / SOFT**2) ** -POWER
            apart = (begin[v, u] - begin[y, x]) / (JUMP * max(begin[v, u], begin[y, x]))
            weight = max(by_color, (1 + apart**2) ** -2)
            matrix[n, n] += weight
            if free[v, u]:
                matrix[n, index[v, u]] -= weight
            else:
                right[n] += weight * begin[v, u]
    np.testing.assert_allclose(values[free], np.linalg.solve(matrix, right), rtol=1e-4)
    np.testing.assert_array_equal(values[~free], begin[~free])


def test_far_depth_is_relaxed_as_near_depth_is() -> None:
    """Law: inverse depth scales with the world, bit for bit by a power of two."""
    rng = np.random.default_rng(2)
    near = rng.uniform(0.5, 1, (24, 32)).astype(np.float32)
    color, loose = rng.uniform(0, 8, (24, 32, 3)).astype(np.float32), rng.random((24, 32)) < 0.8
    far = near / np.float32(1024)
    relax_depth(near, loose, color)
    relax_depth(far, loose, color)
    np.testing.assert_array_equal(far * np.float32(1024), near)


def test_only_missing_depth_is_reached_and_the_sky_stays_far() -> None:
    """Sky above, a wall on no plane below; a patch of each lacks depth, one lies amid an unknown region."""
    color = np.full((60, 80, 3), 90, np.uint8)
    color[:30] = (150, 180, 220)
    w = np.where(np.arange(60)[:, None] < 30, 0, 0.5).repeat(80, 1).astype(np.float32)
    label = np.where(w > 0, SMOOTH, SKY).astype(np.int8)
    missing, unknown = np.zeros(w.shape, np.bool_), np.zeros(w.shape, np.bool_)
    missing[20:45, 10:30] = True
    unknown[10:50, 50:75] = True
    missing[25:35, 60:65] = True
    unknown &= ~missing
    hole = missing | unknown
    known = KnownSurfaces(np.where(hole, 0, w), np.where(hole, SMOOTH, label), np.zeros((0, 3)))
    got = fill_along_colors(color, missing, hole, known, np.zeros_like(missing))
    enclosed = missing.copy()
    enclosed[:, :50] = False
    np.testing.assert_array_equal(got.reached, missing & ~enclosed)
    np.testing.assert_allclose(got.inverse_depth[got.reached], w[got.reached], rtol=1e-5)
    np.testing.assert_array_equal(got.label[got.reached], label[got.reached])


def test_what_has_no_depth_as_a_whole_is_spanned() -> None:
    """Law: between known ends on no plane, in one colour, inverse depth runs from one to the other without a step or a bump."""
    w = np.where(np.arange(50) < 25, 0.5, 0.65).astype(np.float32)[None].repeat(20, 0)
    missing = np.zeros(w.shape, np.bool_)
    missing[:, 20:30] = True
    color, label = np.full((*w.shape, 3), 40, np.uint8), np.full(w.shape, SMOOTH, np.int8)
    known = KnownSurfaces(np.where(missing, 0, w), label, np.zeros((0, 3)))
    got = fill_along_colors(color, missing, missing, known, np.zeros_like(missing)).inverse_depth
    steps = np.diff(got[:, 19:31], axis=1)
    assert (steps > -1e-4).all() and steps.max() < 0.15 / 3


def test_bled_depth_of_a_matcher_does_not_spread() -> None:
    """A wall on a plane, two pixels of it with the depth of what stood before it: in noisy depth the missing ones are wall."""
    w = np.full((40, 60), 0.2, np.float32)
    label = np.ones(w.shape, np.int8)
    w[:, 28:30], label[:, 28:30] = 0.3, SMOOTH
    missing = np.zeros(w.shape, np.bool_)
    missing[:, 30:40] = True
    color, plane = np.full((*w.shape, 3), 90, np.uint8), np.array([[0, 0, 0.2]])
    known = np.where(missing, 0, w), np.where(missing, SMOOTH, label), plane
    noisy, exact = (
        fill_along_colors(color, missing, missing, KnownSurfaces(*known, noise), np.zeros_like(missing)).inverse_depth[
            missing
        ]
        for noise in (0.01, 0.0)
    )
    assert np.allclose(noisy, 0.2)
    assert (exact > 0.25).any()


@pytest.mark.parametrize("where", ["strip at the border", "patch over an edge"])
def test_a_table_continues_as_far_as_its_colour(where: str) -> None:
    """A Kinect sees no depth in places: table, its edge and the floor below continue there as the colours do."""
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


def test_an_object_that_lost_its_depth_keeps_its_outline() -> None:
    """Most of a mug lies in the strip at the border that a Kinect sees no depth of: it ends at its outline."""
    rows, columns = np.indices((HEIGHT, WIDTH))
    mug = (rows - 80) ** 2 + (columns - 100) ** 2 < 22**2
    depth = np.where(mug, 0.8, 1 / (0.3 + 0.005 * rows)).astype(np.float32)
    grain = np.random.default_rng(0).normal(0, 3, (HEIGHT, WIDTH, 3))
    color = (np.where(mug[..., None], (190, 60, 60), (170, 160, 130)) + grain).astype(np.uint8)
    missing = (columns > 90) & (rows > 50) & (rows < 110)
    done = dlama.complete(RGBD(color, np.where(missing, 0, depth).astype(np.float32), CAMERA), [CAMERA])
    off = np.abs(done.view.depth / depth - 1)[missing]
    assert (off > 0.03).mean() < 0.01
