"""Slow literal twins of finding planes: samples, hypotheses and pixels one at a time, planes by solving three equations."""

from __future__ import annotations

import numpy as np


def through(u: np.ndarray, v: np.ndarray, w: np.ndarray, three: np.ndarray) -> np.ndarray:
    """(a, b, c) with w = a u + b v + c at three samples."""
    return np.linalg.solve(np.stack([u[three], v[three], np.ones(3)], 1), w[three])


def support(
    plane: np.ndarray, u: np.ndarray, v: np.ndarray, w: np.ndarray, free: np.ndarray, near: np.ndarray
) -> tuple[int, int]:
    """How many free samples lie on a plane (residual below its own of `near`): surely, and at most."""
    sure = most = 0
    for i in np.flatnonzero(free):
        residual = abs(plane @ (u[i], v[i], 1) - w[i])
        sure += residual < near[i] * (1 - 1e-9)
        most += residual < near[i] * (1 + 1e-9)
    return sure, most


def labels(w: np.ndarray, surface: np.ndarray, planes: np.ndarray, tolerance: float, window: int) -> np.ndarray:
    """1 + index of the plane that each pixel of `surface` lies on: of those that fit it the one that fits most of its
    neighbourhood (mirrored at the border), and more than 3 in 10 of the surface there; the first wins a tie; else -1."""

    def around(picture: np.ndarray, row: int, column: int) -> int:
        return int(np.pad(picture, window // 2, mode="reflect")[row : row + window, column : column + window].sum())

    fits = []
    for plane in planes:
        rows, columns = np.indices(w.shape) + 0.5
        fits.append(surface & (abs(plane[0] * columns + plane[1] * rows + plane[2] - w) < tolerance * w))
    out = np.full(w.shape, -1)
    for row, column in zip(*np.nonzero(surface)):
        counts = [around(fit, row, column) if fit[row, column] else 0 for fit in fits]
        if counts and 10 * max(counts) > 3 * around(surface, row, column):
            out[row, column] = 1 + int(np.argmax(counts))
    return out
