"""Kernels of cells and base colours against their slow literal twins (tests/reference/base_color.py), on small grids."""

from __future__ import annotations

import numpy as np
import pytest

import reference.base_color as twin
from dlama.inpainters.layered.kernels import cells as kernels

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
        kernels.trusted_sources(hole, depth, label, reach), twin.trusted_sources(hole, depth, label, reach)
    )


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_shrink(rng, factor):
    """Oracle: literal twin."""
    color, hole, depth, label = picture(rng)
    source = np.where(hole | (rng.random(SHAPE) < 0.2), -2, label).astype(np.int8)
    for ours, theirs in zip(kernels.shrink(color, depth, source, factor), twin.shrink(color, depth, source, factor)):
        np.testing.assert_allclose(ours, theirs, atol=1e-4)


def test_sums_of_cells(rng):
    """Oracle: literal twin."""
    weights = rng.random(SHAPE).astype(np.float32)
    sums = (weights[..., None] * rng.uniform(0, 255, (*SHAPE, 3))).astype(np.float32)
    for ours, theirs in zip(kernels.pull(sums, weights), twin.pull(sums, weights)):
        np.testing.assert_allclose(ours, theirs, rtol=1e-5)


def test_relax(rng):
    """Oracle: literal twin."""
    usable = rng.random(SHAPE) < 0.8
    cells = np.flatnonzero(usable & (rng.random(SHAPE) < 0.6))
    base = rng.uniform(0, 255, (*SHAPE, 3)).astype(np.float32)
    mean = np.array([10.0, 100.0, 200.0])
    theirs = twin.relax(base, usable, cells, mean, 0.1, 6)
    kernels.relax(base, usable, cells, mean, 0.1, 6)
    np.testing.assert_allclose(base, theirs, atol=1e-2)
