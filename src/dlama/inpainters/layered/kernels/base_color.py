"""Base kernels: known colours on a cell grid in; smooth colours extrapolated into the hole out (numba)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array


def pull(sums: Float32Array, weights: Float32Array) -> tuple[Float32Array, Float32Array]:
    """The next coarser grid: sums over 2 x 2 cells."""
    down, right = (size % 2 for size in weights.shape)
    if down or right:
        edges = 0, down, 0, right, cv2.BORDER_CONSTANT
        sums, weights = (np.asarray(cv2.copyMakeBorder(a, *edges), np.float32) for a in (sums, weights))
    half = weights.shape[1] // 2, weights.shape[0] // 2
    up, upw = (4 * np.asarray(cv2.resize(a, half, interpolation=cv2.INTER_AREA), np.float32) for a in (sums, weights))
    return up, upw


def push(sums: Float32Array, weights: Float32Array, coarser: Float32Array) -> Float32Array:
    """Cells with little weight take the coarser grid's value (bilinear), the others their own mean."""
    rows, cols = weights.shape
    larger = cv2.resize(coarser, (2 * coarser.shape[1], 2 * coarser.shape[0]))[:rows, :cols]
    own = np.minimum(weights, 1)[..., None]
    return np.asarray((1 - own) * larger + own * sums / np.maximum(weights, np.float32(1e-9))[..., None], np.float32)


@kernel
def relax(
    base: Float32Array, usable: BoolArray, cells: NDArray[np.int64], mean: Float32Array, screen: Real, sweeps: Whole
) -> None:
    """Over-relaxed Gauss-Seidel on (n + screen) u = sum of n usable neighbours + screen mean at `cells`, in place."""
    rows, cols = usable.shape
    for sweep in range(sweeps):
        for o in range(len(cells)):
            cell = cells[o] if sweep % 2 == 0 else cells[len(cells) - 1 - o]
            y, x = cell // cols, cell % cols
            for k in range(3):
                total, n = screen * mean[k], screen
                for d in range(4):
                    yy = y + (d == 0) - (d == 1)
                    xx = x + (d == 2) - (d == 3)
                    if 0 <= yy < rows and 0 <= xx < cols and usable[yy, xx]:
                        total += base[yy, xx, k]
                        n += 1
                base[y, x, k] += 1.6 * (total / n - base[y, x, k])
