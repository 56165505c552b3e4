"""Sums in vectors, compared with the same sums one by one in numpy, to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.kernels.jit import kernel
from dlama.geometry.kernels.vectors import RUN, add_one_by_one, compare_one_by_one, four_by_four, squared_difference

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


@kernel
def compare_all(flat: np.ndarray, first: int, out: np.ndarray) -> None:
    """The squared difference of the run from `first` on and of each other run."""
    for other in range(len(out)):
        out[other] = squared_difference(flat, np.uintp(first), np.uintp(other))


def test_vectors_compare_as_single_numbers_do() -> None:
    """Oracle: numpy, to the bit, up to the last number that there is; and the plain sum of squares in double precision."""
    flat = np.random.default_rng(6).normal(100, 60, 3 * RUN).astype(np.float32)
    out, first = np.zeros(2 * RUN + 1, np.float32), 11
    compare_all(flat, first, out)
    assert np.array_equal(out, [compare_one_by_one(flat, first, other) for other in range(len(out))])
    runs = np.lib.stride_tricks.sliding_window_view(flat.astype(float), RUN)
    np.testing.assert_allclose(out, ((runs - runs[first]) ** 2).sum(1), rtol=1e-5)
