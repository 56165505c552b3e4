"""Base kernels: known colours on a cell grid in, smooth colours that reach into the hole out (numba).

Grids of inverse depth say < 0 where a cell plays no part.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import in_bands, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.layered.kernels.cells import between, blend


def pull(sums: Float32Array, weights: Float32Array) -> tuple[Float32Array, Float32Array]:
    """The next coarser grid: sums over 2 x 2 cells."""
    odd = tuple((0, size % 2) for size in weights.shape)
    sums, weights = np.pad(sums, (*odd, (0, 0))), np.pad(weights, odd)
    up, upw = (a[0::2, 0::2] + a[0::2, 1::2] + a[1::2, 0::2] + a[1::2, 1::2] for a in (sums, weights))
    return up, upw


@kernel
def push_rows(first, last, sums, weights, coarser, enough, out):
    """Rows of `push`."""
    for y in range(first, last):
        along = between((y + 0.5) / 2, coarser.shape[0])
        for x in range(weights.shape[1]):
            share = np.float64(weights[y, x] / enough)
            own = share if share < 1 else 1.0
            across = between((x + 0.5) / 2, coarser.shape[1])
            for k in range(3):
                value = 0.0
                if own < 1:
                    value = (1 - own) * blend(coarser, across, along, k)
                if own > 0:
                    value += own * sums[y, x, k] / weights[y, x]
                out[y, x, k] = value


def push(sums: Float32Array, weights: Float32Array, coarser: Float32Array, enough: float) -> Float32Array:
    """Cells with little weight take the coarser grid's value (bilinear), the others their own mean."""
    out = np.empty((*weights.shape, 3), np.float32)
    in_bands(push_rows, len(weights), sums, weights, coarser, np.float32(enough), out, band=64)
    return out


@kernel
def relax(base, usable, cells, mean, screen, sweeps):
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


@kernel
def farthest_rows(first, last, colors, depths, sources, out, far):
    """Rows of `farthest`."""
    for r in range(first, last):
        for c in range(far.shape[1]):
            y1, x1 = min(depths.shape[0], 2 * r + 2), min(depths.shape[1], 2 * c + 2)
            least = np.inf
            for y in range(2 * r, y1):
                for x in range(2 * c, x1):
                    if sources[y, x] != -2 and depths[y, x] < least:
                        least = np.float64(depths[y, x])
            n, w = 0, 0.0
            for y in range(2 * r, y1):
                for x in range(2 * c, x1):
                    if sources[y, x] != -2 and depths[y, x] <= 1.1 * least:
                        n += 1
                        w += depths[y, x]
                        for k in range(3):
                            out[r, c, k] += colors[y, x, k]
            if n > 0:
                far[r, c] = w / n
                for k in range(3):
                    out[r, c, k] /= n


def farthest(
    colors: Float32Array, depths: Float32Array, sources: NDArray[np.int32]
) -> tuple[Float32Array, Float32Array]:
    """Cells of 2 x 2 blocks: mean colour and inverse depth of the blocks within 10 % of the farthest known; depth -1: none."""
    grid = tuple((size + 1) // 2 for size in depths.shape)
    out, far = np.zeros((*grid, 3), np.float32), np.full(grid, -1, np.float32)
    in_bands(farthest_rows, grid[0], colors, depths, sources, out, far)
    return out, far


@kernel
def even_rows(first, last, colors, far, radius, out):
    """Rows of `even_out`."""
    rows, cols = far.shape
    for y in range(first, last):
        for x in range(cols):
            if far[y, x] < 0:
                continue
            n = 0
            for j in range(max(0, y - radius), min(rows, y + radius + 1)):
                for i in range(max(0, x - radius), min(cols, x + radius + 1)):
                    if far[j, i] >= 0 and abs(far[j, i] - far[y, x]) <= 0.08 * far[y, x]:
                        n += 1
                        for k in range(3):
                            out[y, x, k] += colors[j, i, k]
            for k in range(3):
                out[y, x, k] /= n


def even_out(colors: Float32Array, far: Float32Array, radius: int) -> Float32Array:
    """Known cells (far >= 0) blurred over a window, over cells within 8 % of their own inverse depth only."""
    out = np.zeros(colors.shape, np.float32)
    in_bands(even_rows, len(far), colors, far, radius, out)
    return out


@kernel
def spread(base, depth, reached, cells, mean, screen, sweeps):
    """Colour flows into `cells` (flat, rim first) from neighbours of like depth, never from nearer ones; in place.

    depth: inverse depth of all cells, < 0 where a cell plays no part. reached: True where base holds a colour. The first
    sweep fills, the others settle to the weighted mean of the neighbours; weights fall with the ratio of depths.
    mean: len(cells) x 3, towards which colour is pulled with weight screen[cell]; base keeps what it held where neither that
    nor a neighbour has a say.
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


@kernel
def skirt_rows(first, last, base, depth, inside, out):
    """Rows of `skirt`; out: a copy of base."""
    rows, cols = depth.shape
    for y in range(first, last):
        for x in range(cols):
            if inside[y, x]:
                continue
            n, least, red, green, blue = 0, np.inf, 0.0, 0.0, 0.0
            for j in range(max(0, y - 1), min(rows, y + 2)):
                for i in range(max(0, x - 1), min(cols, x + 2)):
                    if inside[j, i]:
                        n += 1
                        least = depth[j, i] if depth[j, i] < least else least
                        red += base[j, i, 0]
                        green += base[j, i, 1]
                        blue += base[j, i, 2]
            if n > 0 and (depth[y, x] < 0 or depth[y, x] > 1.1 * least):
                out[y, x, 0], out[y, x, 1], out[y, x, 2] = red / n, green / n, blue / n


def skirt(base: Float32Array, depth: Float32Array, inside: BoolArray) -> Float32Array:
    """A base for sampling inside only: cells beside it that are unknown or nearer take the mean of their inside neighbours.

    depth: inverse depth, < 0 where unknown. Without this, bilinear sampling at the rim would mix the occluder in.
    """
    out = base.copy()
    in_bands(skirt_rows, len(depth), base, depth, inside, out)
    return out
