"""Numba kernel of relaxation: conductances, pulls and levels in; levels after one sweep out."""

from __future__ import annotations

from dlama.geometry.kernels.jit import kernel
from dlama.geometry.rgbd import BoolArray, Float32Array


@kernel
def relax(
    across: Float32Array,
    down: Float32Array,
    open_: BoolArray,
    pull: Float32Array,
    target: Float32Array,
    over: float,
    level: Float32Array,
) -> float:
    """One sweep of successive over-relaxation towards the minimum of sum c (difference of neighbours)^2 + pull (level -
    target)^2.

    across, down: H x W, the c of a pixel and its right and its lower neighbour. pull, target: H x W. over: 1..2. level: H x W,
    changed where open. Returns the largest change.
    """
    rows, columns = level.shape
    most = 0.0
    for row in range(rows):
        for column in range(columns):
            if not open_[row, column]:
                continue
            weight = float(pull[row, column])
            total = weight * target[row, column]
            if column > 0:
                total += across[row, column - 1] * level[row, column - 1]
                weight += across[row, column - 1]
            if column < columns - 1:
                total += across[row, column] * level[row, column + 1]
                weight += across[row, column]
            if row > 0:
                total += down[row - 1, column] * level[row - 1, column]
                weight += down[row - 1, column]
            if row < rows - 1:
                total += down[row, column] * level[row + 1, column]
                weight += down[row, column]
            change = over * (total / weight - level[row, column])
            level[row, column] += change
            most = max(most, abs(change))
    return most
