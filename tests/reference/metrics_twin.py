"""Slow literal twins of the metrics: SSIM by its formula on every window, nearest neighbours by comparing all pairs."""

from __future__ import annotations

import numpy as np


def nearest(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """N distances to the nearest of M others."""
    return np.array([min(float(np.sqrt(((p - q) ** 2).sum())) for q in others) for p in points])


def left_right(left: np.ndarray, right: np.ndarray, disparity: np.ndarray, slack: float = 1.0) -> float:
    """Mean absolute difference over the pixels of the left picture that the right one shows too, pixel by pixel.

    A pixel is hidden where another of the same row, nearer by more than `slack`, lands on a column it is read from.
    """
    height, width = disparity.shape
    differences = []
    for row in range(height):
        lands = {x: x - float(disparity[row, x]) for x in range(width) if 0 < abs(disparity[row, x]) < np.inf}
        lands = {x: at for x, at in lands.items() if 0 <= at <= width - 1}
        for x, at in lands.items():
            mine = {int(np.floor(at)), int(np.ceil(at))}
            if any(
                mine & {int(np.floor(other)), int(np.ceil(other))} and disparity[row, o] > disparity[row, x] + slack
                for o, other in lands.items()
            ):
                continue
            low, high = int(np.floor(at)), int(np.ceil(at))
            part = at - low
            read = (1 - part) * right[row, low].astype(float) + part * right[row, high].astype(float)
            differences.append(np.abs(left[row, x].astype(float) - read).mean())
    return float(np.mean(differences)) if differences else float("nan")
