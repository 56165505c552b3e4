"""Numba kernel for depth on no plane: a picture and initial depth in; the conductance between neighbours out."""

from __future__ import annotations

from dlama.geometry.kernels.jit import Real, Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array


@kernel
def conductances(
    first: Whole,
    last: Whole,
    across: Float32Array,
    down: Float32Array,
    where: BoolArray,
    begin: Float32Array,
    color: Float32Array,
    step: Real,
    power: Real,
    jump: Real,
) -> None:
    """Conductance from the pixels of `where` to their right neighbours (across, H x W) and to their lower ones (down, H x W).

    Colours d levels apart (root of the sum over channels) give (1 + (d / step)^2)^-power. Values of `begin` (H x W) that differ
    by e of the larger one give at least (1 + (e / jump)^2)^-2; a value of 0 (far, unknown) gives 0. where: H x W; color: H x W
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
                apart = (begin[y, x] - begin[row, column]) / (jump * max(begin[y, x], begin[row, column]))
                drawn = max((1.0 + unlike / (step * step)) ** -power, 1.0 / (1.0 + apart * apart) ** 2)
                if k == 0:
                    across[row, column] = drawn
                else:
                    down[row, column] = drawn
