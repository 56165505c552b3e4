"""Numba kernel of distances that colours lengthen: a map with its sources at 0, and colours, in; the distances out."""

from __future__ import annotations

from dlama.geometry.kernels.jit import Real, Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array


@kernel
def sweep_by_color(
    first: Whole,
    last: Whole,
    distance: Float32Array,
    free: BoolArray,
    color: Float32Array,
    step: Real,
    dearest: Real,
    rounds: Whole,
) -> None:
    """Shortest ways through the `free` cells of planes first..last, by raster sweeps there and back (chamfer, 8 neighbours).

    distance: L x h x w, 0 at sources, large elsewhere, written to. color: h x w x 3. A step between cells that differ by d levels
    (root of the sum over channels) is 1 + (d / step)^2 times as long, at most 1 + `dearest`.
    """
    rows, columns = free.shape
    for plane in range(first, last):
        for turn in range(2 * rounds):
            way = 1 if turn % 2 == 0 else -1
            for i in range(rows):
                row = i if way == 1 else rows - 1 - i
                for j in range(columns):
                    column = j if way == 1 else columns - 1 - j
                    if not free[row, column]:
                        continue
                    best = float(distance[plane, row, column])
                    for k in range(4):
                        y = row - way * (0 if k == 0 else 1)
                        x = column - way * (1 if k == 0 else k - 2)
                        if y < 0 or y >= rows or x < 0 or x >= columns:
                            continue
                        unlike = 0.0
                        for channel in range(3):
                            unlike += (color[row, column, channel] - color[y, x, channel]) ** 2
                        length = 1.41421356 if k == 1 or k == 3 else 1.0
                        best = min(best, distance[plane, y, x] + length * (1.0 + min(unlike / (step * step), dearest)))
                    distance[plane, row, column] = best
