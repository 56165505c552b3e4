"""Base kernels: known colours on a cell grid in; smooth colours extrapolated into the hole out (numba).

An inverse depth < 0 marks a cell that is not used.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.holes import square
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


def farthest(
    colors: Float32Array, depths: Float32Array, sources: NDArray[np.int8]
) -> tuple[Float32Array, Float32Array]:
    """Cells of 2 x 2 blocks: mean colour and inverse depth of the blocks within 10 % of the farthest known; depth -1: none.

    colors: H x W x 3; depths: H x W inverse depth (1/m); sources: H x W, -2 where a block is not known
    """
    rows, cols = ((size + 1) // 2 for size in depths.shape)
    padding = tuple((0, size % 2) for size in depths.shape)
    colors, depths = np.pad(colors, (*padding, (0, 0))), np.pad(depths, padding).astype(np.float64)
    known = np.pad(sources != -2, padding)
    quarters = [np.s_[j::2, i::2] for j in range(2) for i in range(2)]
    least = np.min([np.where(known[q], depths[q], np.inf) for q in quarters], axis=0)
    count, total, out = np.zeros((rows, cols)), np.zeros((rows, cols)), np.zeros((rows, cols, 3), np.float32)
    for q in quarters:
        taken = known[q] & (depths[q] <= 1.1 * least)
        count += taken
        total += np.where(taken, depths[q], 0)
        out += np.where(taken[..., None], colors[q], np.float32(0))
    some = np.maximum(count, 1)
    return (out / some[..., None]).astype(np.float32), np.where(count > 0, total / some, -1).astype(np.float32)


def even_out(colors: Float32Array, far: Float32Array, radius: int) -> Float32Array:
    """Known cells (far >= 0) blurred over a window, over cells within 8 % of their own inverse depth only. (numpy)"""
    (rows, cols), size = far.shape, 2 * radius + 1
    around = np.pad(far, radius, constant_values=-1)
    padded = np.pad(colors, ((radius, radius), (radius, radius), (0, 0)))
    close = 0.08 * far.astype(np.float64)
    count, out = np.zeros(far.shape), np.zeros(colors.shape, np.float32)
    for window in (np.s_[j : j + rows, i : i + cols] for j in range(size) for i in range(size)):
        taken = (far >= 0) & (around[window] >= 0) & (np.abs(around[window] - far) <= close)
        count += taken
        out += np.where(taken[..., None], padded[window], np.float32(0))
    return (out / np.maximum(count, 1)[..., None]).astype(np.float32)


@kernel
def spread(
    base: Float32Array,
    depth: Float32Array,
    reached: BoolArray,
    cells: NDArray[np.int64],
    mean: Float64Array,
    screen: Float32Array,
    sweeps: Whole,
) -> None:
    """Diffuse colour into `cells` (flat, rim first) from neighbours of similar depth, never from nearer ones; in place.

    depth: inverse depth of all cells, < 0 where not used. reached: True where base holds a colour. The first sweep fills; the
    others settle to the weighted mean of the neighbours, with weights by the ratio of depths. mean: len(cells) x 3, a target
    with weight screen[cell]. base keeps its value where neither it nor a neighbour counts.
    """
    rows, cols = depth.shape
    for sweep in range(sweeps):
        for o in range(len(cells)):
            p = o if sweep % 2 == 0 else len(cells) - 1 - o
            y, x = cells[p] // cols, cells[p] % cols
            own = depth[y, x] + 1e-6
            hold = screen[p]
            total, red, green, blue = hold, hold * mean[p, 0], hold * mean[p, 1], hold * mean[p, 2]
            for d in range(4):
                yy = y + (d == 0) - (d == 1)
                xx = x + (d == 2) - (d == 3)
                if yy < 0 or xx < 0 or yy >= rows or xx >= cols or not reached[yy, xx]:
                    continue
                other = depth[yy, xx] + 1e-6
                if depth[yy, xx] < 0 or other > 1.1 * own:
                    continue
                ratio = other / own if other < own else own / other
                share = ratio**4
                share = share if share > 0.02 else 0.02
                total += share
                red += share * base[yy, xx, 0]
                green += share * base[yy, xx, 1]
                blue += share * base[yy, xx, 2]
            if total > 0:
                base[y, x, 0], base[y, x, 1], base[y, x, 2] = red / total, green / total, blue / total
            reached[y, x] = reached[y, x] or total > hold


def skirt(base: Float32Array, depth: Float32Array, inside: BoolArray) -> Float32Array:
    """A base for sampling inside only: adjacent cells that are unknown or nearer take the mean of their inside neighbours.

    depth: inverse depth, < 0 where unknown. Without this, bilinear sampling at the rim would mix the occluder in.
    """
    count, total = (
        cv2.boxFilter(each, cv2.CV_64F, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
        for each in (inside.view(np.uint8), np.where(inside[..., None], base, np.float32(0)))
    )
    least = cv2.erode(np.where(inside, depth, np.float32(np.inf)), square(3)).astype(np.float64)
    adjacent = ~inside & (count > 0) & ((depth < 0) | (depth > 1.1 * least))
    out = base.copy()
    out[adjacent] = total[adjacent] / count[adjacent, None]
    return out
