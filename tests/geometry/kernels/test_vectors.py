"""Sums in vectors, compared with the same sums one by one in numpy, to the bit."""

from __future__ import annotations

import numpy as np

from dlama.geometry.kernels.jit import kernel
from dlama.geometry.kernels.vectors import RUN, compare_one_by_one, squared_difference


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
