"""The texture kernels against their slow literal twins (tests/reference/texture.py), value by value, on small grids."""

from __future__ import annotations

import numpy as np
import pytest

import reference.texture as twin
from dlama.inpainters.layered.kernels import base_color as base_kernels
from dlama.inpainters.layered.kernels import cells as cell_kernels
from dlama.inpainters.layered.kernels import patch_offsets as kernels

SHAPE = (17, 22)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def picture(rng):
    """Colour, hole, inverse depth and labels: two planes, sky and a rough patch, with noise in depth."""
    color = rng.integers(0, 256, (*SHAPE, 3), dtype=np.uint8)
    label = np.ones(SHAPE, np.int8)
    label[:5], label[:, 12:], label[9:14, 3:9] = 0, 2, -1
    depth = np.select([label == 0, label == 1, label == 2], [0, 0.3, 0.2], 0.5) * rng.uniform(0.97, 1.1, SHAPE)
    return color, rng.random(SHAPE) < 0.05, depth.astype(np.float32), label


@pytest.mark.parametrize("reach", [0, 1, 2])
def test_trusted_sources(rng, reach):
    """Oracle: literal twin."""
    _, hole, depth, label = picture(rng)
    np.testing.assert_array_equal(
        cell_kernels.trusted_sources(hole, depth, label, reach), twin.trusted_sources(hole, depth, label, reach)
    )


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_shrink(rng, factor):
    """Oracle: literal twin."""
    color, hole, depth, label = picture(rng)
    source = np.where(hole | (rng.random(SHAPE) < 0.2), -2, label).astype(np.int8)
    for ours, theirs in zip(
        cell_kernels.shrink(color, depth, source, factor), twin.shrink(color, depth, source, factor)
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-4)


def test_pyramid(rng):
    """Oracle: literal twin of pull and push."""
    weights = (1.4 * rng.random(SHAPE) * (rng.random(SHAPE) < 0.6)).astype(np.float32)
    sums = (weights[..., None] * rng.uniform(0, 255, (*SHAPE, 3))).astype(np.float32)
    coarse = base_kernels.pull(sums, weights)
    for ours, theirs in zip(coarse, twin.pull(sums, weights)):
        np.testing.assert_allclose(ours, theirs, rtol=1e-5)
    grid = rng.uniform(0, 255, coarse[0].shape).astype(np.float32)
    np.testing.assert_allclose(base_kernels.push(sums, weights, grid), twin.push(sums, weights, grid), atol=1e-3)


def test_relax(rng):
    """Oracle: literal twin."""
    usable = rng.random(SHAPE) < 0.8
    cells = np.flatnonzero(usable & (rng.random(SHAPE) < 0.6))
    base = rng.uniform(0, 255, (*SHAPE, 3)).astype(np.float32)
    mean = np.array([10.0, 100.0, 200.0])
    theirs = twin.relax(base, usable, cells, mean, 0.1, 6)
    base_kernels.relax(base, usable, cells, mean, 0.1, 6)
    np.testing.assert_allclose(base, theirs, atol=1e-2)


def test_depth_base(rng):
    """Oracle: literal twins of farthest, even_out, spread and skirt."""
    color, hole, depth, label = picture(rng)
    sources = np.where(hole | (rng.random(SHAPE) < 0.3), -2, label).astype(np.int8)
    ours = base_kernels.farthest(color.astype(np.float32), depth, sources)
    for a, b in zip(ours, twin.farthest(color.astype(float), depth, sources)):
        np.testing.assert_allclose(a, b, rtol=1e-5)
    colors, far = ours
    far[rng.random(far.shape) < 0.4] = -1
    base = base_kernels.even_out(colors, far, 2)
    np.testing.assert_allclose(base, twin.even_out(colors, far, 2), rtol=1e-5)
    cells = np.flatnonzero(far < 0)
    full = np.where(far < 0, rng.uniform(0, 0.6, far.shape), far).astype(np.float32)
    mean = rng.uniform(0, 255, (len(cells), 3))
    screen = 0.01 * (rng.random(len(cells)) < 0.7)
    theirs = twin.spread(base, full, far >= 0, cells, mean, screen, 5)
    base_kernels.spread(base, full, far >= 0, cells, mean, screen, 5)
    np.testing.assert_allclose(base, theirs, atol=1e-2)
    partly = np.where(rng.random(far.shape) < 0.2, np.float32(-1), full)
    inside = (partly >= 0) & (rng.random(far.shape) < 0.5)
    ours = base_kernels.skirt(base, partly, inside)
    assert (ours != base).any()
    np.testing.assert_allclose(ours, twin.skirt(base, partly, inside), atol=1e-3)


def shift_setting(rng):
    """A slanted plane with a hole, its axes (any will do for the twins) and shifts that stay in the picture or do not."""
    color, _, _, _ = picture(rng)
    v, u = np.mgrid[: SHAPE[0], : SHAPE[1]] + 0.5
    depth = (0.2 + 0.004 * u + 0.01 * v).astype(np.float32)
    source = np.full(SHAPE, 1, np.int8)
    source[4:11, 9:] = -2
    axes = np.array([[20.0, 0, -0.3], [6.0, 18.0, 0.4]])
    return color, depth, source, axes, rng.uniform(-1, 1, (12, 2))


def test_scores(rng):
    """Oracle: literal twins of correlate and change_of_scale; the case must hold reachable and unreachable places."""
    _, depth, source, axes, shifts = shift_setting(rng)
    detail = rng.normal(0, 20, (*SHAPE, 3)).astype(np.float32)
    y, x = np.nonzero(source == 1)
    points = np.stack([x + 0.5, y + 0.5, depth[y, x]], 1).astype(np.float64)[::7]
    where = (1, depth, source, 1, axes)
    scores = kernels.correlate(shifts, points, detail, kernels.Sources(*where), 8)
    assert (scores != 0).any() and (scores == 0).any()
    np.testing.assert_allclose(scores, twin.correlate(shifts, points, detail, *where, 8), atol=1e-5)
    scale = kernels.change_of_scale(shifts, points, kernels.Sources(*where))
    assert (scale >= 0).any() and (scale < 0).any()
    np.testing.assert_allclose(scale, twin.change_of_scale(shifts, points, *where), atol=1e-5)


def test_assign(rng):
    """Oracle: literal twin."""
    inside = rng.random((9, 11)) < 0.7
    order = rng.permutation(np.flatnonzero(inside))
    index = np.full(inside.shape, -1, np.int32)
    index[inside] = np.arange(inside.sum())
    cost = rng.uniform(0, 1.5, (inside.sum(), 6)).astype(np.float32)
    cost[rng.random(cost.shape) < 0.3] = 1e6
    cost[0] = 1e6
    brought = rng.normal(0, 20, (*cost.shape, 3)).astype(np.float32)
    ours = np.full(len(cost), -1, np.int32)
    kernels.assign_cells(index, kernels.Choices(cost, brought, ours), order, 0.01, 4)
    assert ours[0] == -1
    np.testing.assert_array_equal(ours, twin.assign(index, cost, brought, order, 0.01, 4))


def test_paint(rng):
    """Oracle: literal twin, to one grey level (a rounding may fall either way)."""
    color, depth, source, axes, shifts = shift_setting(rng)
    pixels = np.flatnonzero(source == -2)
    grid = (5, 6)
    bases = tuple(rng.uniform(60, 190, (*grid, 3)).astype(np.float32) for _ in range(2))
    pick = rng.integers(-1, len(shifts), grid).astype(np.int32)
    gains = rng.random((*grid, 3)).astype(np.float32)
    surface, cells = (depth, source, 1, axes), (4, pick, gains, shifts)
    theirs = twin.paint(color, color, pixels, *surface, bases, *cells)
    ours, room = color.copy(), np.zeros((len(pixels), 3))
    sources, paint = kernels.Sources(1, *surface), kernels.Paint(color, *bases, *cells)
    kernels.paint_pixels(0, len(pixels), pixels, sources, paint, room, ours)
    assert (ours != color).any()
    assert np.abs(ours.astype(int) - theirs).max() <= 1
