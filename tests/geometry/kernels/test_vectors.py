"""Sums of 4 x 4 pixels in vectors, compared with the same sums one by one in numpy, to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.kernels.drawing.vectors import add_one_by_one, four_by_four
from dlama.geometry.kernels.jit import kernel

WIDTH, HEIGHT = 9, 7


@kernel
def weigh_all(knots: np.ndarray, weights: np.ndarray, out: np.ndarray) -> None:
    """The sum from each place on that has 4 x 4 pixels and one more after them."""
    along = weights[0], weights[1], weights[2], weights[3]
    down = weights[4], weights[5], weights[6], weights[7]
    for upper in range(HEIGHT - 4):
        for left in range(WIDTH - 3):
            first = np.uintp(3 * (upper * WIDTH + left))
            color = four_by_four(knots, first, np.uintp(3 * WIDTH), along, down)
            out[upper, left, 0], out[upper, left, 1], out[upper, left, 2] = color


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_vectors_add_in_the_order_of_single_numbers(kind: type) -> None:
    """Oracle: numpy, which rounds after each operation; weights of both widths."""
    rng = np.random.default_rng(5)
    knots = rng.normal(100, 60, WIDTH * HEIGHT * 3).astype(np.float32)
    weights = rng.normal(0.2, 0.5, 8).astype(kind)
    out = np.zeros((HEIGHT - 4, WIDTH - 3, 3), kind)
    weigh_all(knots, weights, out)
    for upper in range(HEIGHT - 4):
        for left in range(WIDTH - 3):
            first = 3 * (upper * WIDTH + left)
            expected = add_one_by_one(knots, first, 3 * WIDTH, tuple(weights[:4]), tuple(weights[4:]))
            assert np.array_equal(out[upper, left], np.array(expected, kind))
