"""Thrown shapes against a literal twin, and the flux through a border against Gauss's theorem."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dlama.perception.kernels.shadows import DIRECTIONS_A_TASK, cast_shapes
from dlama.perception.shadows.search import divergence_of


def test_thrown_shapes_against_a_twin() -> None:
    """Sets of pixels, one direction after the other."""
    rng = np.random.default_rng(0)
    foot, rise = rng.uniform((-1, 1, 2), (1, 1.2, 4), (60, 3)), rng.uniform(0, 1, 60)
    over = rng.normal(0, 0.5, (DIRECTIONS_A_TASK + 5, 3))
    values, seen, lens = rng.normal(0, 1, (30, 40)), rng.random((30, 40)) < 0.8, np.array([20.0, 20.0, 20.0, 12.0])
    out, stamps = np.zeros((len(over), 3)), np.zeros((2, 30, 40), np.int32)
    cast_shapes(0, len(over), foot, rise, over, lens, values, seen, stamps, out)
    for k, direction in enumerate(over):
        shape = set()
        for x, y, z in foot + rise[:, None] * direction:
            if z > 1e-3:
                u, v = math.floor(x / z * 20 + 20), math.floor(y / z * 20 + 12)
                shape |= {(v + i, u + j) for i in (0, 1) for j in (0, 1) if 0 <= v + i < 30 and 0 <= u + j < 40}
        inside = [p for p in shape if seen[p]]
        border = [
            (v, u)
            for v, u in inside
            if 0 < v < 29 and 0 < u < 39 and not {(v - 1, u), (v + 1, u), (v, u - 1), (v, u + 1)} <= shape
        ]
        expected = sum(values[p] for p in inside), len(inside), len(border)
        assert out[k] == pytest.approx(expected), k


def test_the_flux_through_a_border_is_the_sum_inside() -> None:
    """A square darker by the factor 0.8: its flux is the step in log luma times the border's length, and without one it is 0."""
    color = np.full((60, 80, 3), 150, np.uint8)
    color[20:40, 30:50] = 120
    divergence, spread = divergence_of(color, np.ones((60, 80), np.bool_))
    step = math.log(154) - math.log(124)
    assert divergence.sum() == pytest.approx(0, abs=1e-4)
    assert divergence[20:40, 30:50].sum() == pytest.approx(step * 0.4 * 80, rel=0.35)
    assert spread > 1e-3
