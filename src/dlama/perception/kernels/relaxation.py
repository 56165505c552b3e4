"""Numba kernels for depth on no plane: picture and initial depth in; conductances between neighbours, and relaxed depth, out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array

SOFT, POWER, JUMP = 2.0, 3.0, 0.1
"""Colour step in levels, exponent, and the relative step of inverse depth above which conductance falls."""


@kernel
def conductances(
    first: Whole,
    last: Whole,
    across: Float32Array,
    down: Float32Array,
    where: BoolArray,
    begin: Float32Array,
    color: Float32Array,
) -> None:
    """Conductance from the pixels of `where` to their right neighbours (across, H x W) and to their lower ones (down, H x W).

    Colours d levels apart (root of the sum over channels) give (1 + (d / SOFT)^2)^-POWER. Values of `begin` (H x W) that differ
    by e of the larger one give at least (1 + (e / JUMP)^2)^-2; a value of 0 (far, unknown) gives 0. where: H x W; color: H x W
    x 3.
    """
    rows, columns = begin.shape
    for row in range(first, last):
        for column in range(columns):
            across[row, column] = down[row, column] = 0.0
            for k in range(2):
                y, x = row + k, column + 1 - k
                if not where[row, column] or y >= rows or x >= columns or begin[row, column] <= 0 or begin[y, x] <= 0:
                    continue
                unlike = 0.0
                for channel in range(3):
                    unlike += (color[row, column, channel] - color[y, x, channel]) ** 2
                apart = (begin[y, x] - begin[row, column]) / (JUMP * max(begin[y, x], begin[row, column]))
                drawn = max((1.0 + unlike / (SOFT * SOFT)) ** -POWER, 1.0 / (1.0 + apart * apart) ** 2)
                if k == 0:
                    across[row, column] = drawn
                else:
                    down[row, column] = drawn


@kernel
def relax(
    across: Float32Array,
    down: Float32Array,
    starts: NDArray[np.int64],
    columns: NDArray[np.int64],
    pull: Real,
    target: Float32Array,
    level: Float32Array,
    changes: NDArray[np.float64],
) -> None:
    """Sweeps of successive over-relaxation towards the minimum of sum c (difference of neighbours)^2 + pull (level - target)^2.

    across, down: H x W, the c of a pixel and its right and its lower neighbour. columns: of the pixels that are moved, row by
    row; starts: H + 1, where each row begins in them. pull: a float32. target: H x W. level: H x W, changed there. changes: the
    largest change of each sweep, of which there are as many. Each is two rows behind the one before it: so none waits for
    another, and all find these rows in the processor's cache.
    """
    rows, width = level.shape
    for turn in range(len(changes)):
        changes[turn] = 0.0
    for ahead in range(rows + 2 * len(changes) - 2):
        for turn in range(max(0, -((rows - 1 - ahead) // 2)), min(len(changes), ahead // 2 + 1)):
            row = ahead - 2 * turn
            for k in range(starts[row], starts[row + 1]):
                column = columns[k]
                weight = pull
                total = weight * target[row, column]
                if column > 0:
                    total += across[row, column - 1] * level[row, column - 1]
                    weight += across[row, column - 1]
                if column < width - 1:
                    total += across[row, column] * level[row, column + 1]
                    weight += across[row, column]
                if row > 0:
                    total += down[row - 1, column] * level[row - 1, column]
                    weight += down[row - 1, column]
                if row < rows - 1:
                    total += down[row, column] * level[row + 1, column]
                    weight += down[row, column]
                change = 1.8 * (total / weight - level[row, column])
                level[row, column] += change
                changes[turn] = max(changes[turn], abs(change))
