"""Slow literal twin of the edge kernels: inverse depth in; joined neighbours and flying pixels out, line by line."""

from __future__ import annotations

import itertools

import numpy as np


def joined_along(line: list[float], ratio: float, least: float = 0.0) -> list[bool]:
    """For each neighbouring pair of a line of inverse depths (0 = nothing there): do both lie on one surface?

    Yes if the step between them is small (`ratio` of the larger, or `least`), or if it continues like a slope: equal (to 20 %) to
    the steps on both sides of it,
    to the two before it, or to the two after it.
    """
    steps = [b - a if a > 0 and b > 0 else None for a, b in itertools.pairwise(line)]

    def like(number: int, step: float) -> bool:
        other = steps[number] if 0 <= number < len(steps) else None
        return other is not None and abs(other - step) <= 0.2 * abs(step)

    answers = []
    for n, step in enumerate(steps):
        if step is None:
            answers.append(False)
            continue
        small = abs(step) <= max(ratio * max(line[n], line[n + 1]), least)
        both_sides = like(n - 1, step) and like(n + 1, step)
        before = like(n - 1, step) and like(n - 2, step)
        after = like(n + 1, step) and like(n + 2, step)
        answers.append(small or both_sides or before or after)
    return answers


def joints(w: np.ndarray, ratio: float, least: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Right joints (H x W-1) and lower joints (H-1 x W) of a grid of inverse depths."""
    height, width = w.shape
    right = np.array([joined_along(row.tolist(), ratio, least) for row in w], np.bool_).reshape(height, width - 1)
    down = (
        np.array([joined_along(column.tolist(), ratio, least) for column in w.T], np.bool_).reshape(width, height - 1).T
    )
    return right, down


def flying_along(line: list[float], joined: list[bool], ratio: float, least: float = 0.0) -> list[bool]:
    """Pixels of a line that hang between two surfaces: joined to neither neighbour, clearly between both in depth."""
    answers = [False] * len(line)
    for n in range(1, len(line) - 1):
        low, high = sorted((line[n - 1], line[n + 1]))
        alone = not joined[n - 1] and not joined[n]
        clear = low * (1 + ratio) < line[n] < high * (1 - ratio) and low < line[n] - least and line[n] < high - least
        answers[n] = alone and low > 0 and clear
    return answers


def flying(w: np.ndarray, ratio: float, least: float = 0.0) -> np.ndarray:
    """bool H x W: flying along its row or along its column."""
    right, down = joints(w, ratio, least)
    rows = [flying_along(line.tolist(), joined.tolist(), ratio, least) for line, joined in zip(w, right)]
    columns = [flying_along(line.tolist(), joined.tolist(), ratio, least) for line, joined in zip(w.T, down.T)]
    return np.array(rows, np.bool_) | np.array(columns, np.bool_).T
