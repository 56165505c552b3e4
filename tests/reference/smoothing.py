"""Slow literal twin of the kernel that averages noise: the pixel and its pairs, one by one."""

from __future__ import annotations

import numpy as np


def average_pairs(w: np.ndarray, constant: float, share: float, reach: int) -> np.ndarray:
    """H x W inverse depth (1/m, 0 = none): the mean of each pixel and of the pairs opposite each other that agree with it."""
    height, width = w.shape
    out = w.copy()
    for row in range(height):
        for column in range(width):
            here = float(w[row, column])
            values = [here]
            for down in range(-reach, reach + 1):
                for right in range(-reach, reach + 1):
                    if (down, right) <= (0, 0):
                        continue
                    there = (row + down, column + right), (row - down, column - right)
                    if not all(0 <= r < height and 0 <= c < width for r, c in there):
                        continue
                    one, other = (float(w[place]) for place in there)
                    if one > 0 and other > 0 and abs((one + other) / 2 - here) <= max(constant, share * here):
                        values += [one, other]
            if here > 0:
                out[row, column] = np.mean(values)
    return out
