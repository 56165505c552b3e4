"""Base kernels: known colours on a cell grid in, smooth colours that reach into the hole out (numba).

Grids of inverse depth say < 0 where a cell plays no part.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def pull(sums, weights):
    """The next coarser grid: sums over 2 x 2 cells."""
    rows, cols = weights.shape
    up, upw = (
        np.zeros(((rows + 1) // 2, (cols + 1) // 2, 3), np.float32),
        np.zeros(((rows + 1) // 2, (cols + 1) // 2), np.float32),
    )
    for y in range(rows):
        for x in range(cols):
            upw[y // 2, x // 2] += weights[y, x]
            for k in range(3):
                up[y // 2, x // 2, k] += sums[y, x, k]
    return up, upw


@njit(cache=True)
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


@njit(cache=True)
def farthest(colors, depths, sources):
    """Cells of 2 x 2 blocks: mean colour and inverse depth of the blocks within 10 % of the farthest known; depth -1: none."""
    rows, cols = (depths.shape[0] + 1) // 2, (depths.shape[1] + 1) // 2
    out = np.zeros((rows, cols, 3), np.float32)
    far = np.full((rows, cols), -1, np.float32)
    for r in range(rows):
        for c in range(cols):
            y1, x1 = min(depths.shape[0], 2 * r + 2), min(depths.shape[1], 2 * c + 2)
            least = np.inf
            for y in range(2 * r, y1):
                for x in range(2 * c, x1):
                    if sources[y, x] != -2:
                        least = min(least, depths[y, x])
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
    return out, far


@njit(cache=True)
def even_out(colors, far, radius):
    """Known cells (far >= 0) blurred over a window, over cells within 8 % of their own inverse depth only."""
    rows, cols = far.shape
    out = np.zeros((rows, cols, 3), np.float32)
    for y in range(rows):
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
    return out


@njit(cache=True)
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
                share = max(0.02, min(other / own, own / other) ** 4)
                total += share
                red += share * base[yy, xx, 0]
                green += share * base[yy, xx, 1]
                blue += share * base[yy, xx, 2]
            if total > 0:
                base[y, x, 0], base[y, x, 1], base[y, x, 2] = red / total, green / total, blue / total
            reached[y, x] = reached[y, x] or total > hold


@njit(cache=True)
def skirt(base, depth, inside):
    """A base for sampling inside only: cells beside it that are unknown or nearer take the mean of their inside neighbours.

    depth: inverse depth, < 0 where unknown. Without this, bilinear sampling at the rim would mix the occluder in.
    """
    rows, cols = depth.shape
    out = base.copy()
    for y in range(rows):
        for x in range(cols):
            if inside[y, x]:
                continue
            n, least, total = 0, np.inf, np.zeros(3)
            for j in range(max(0, y - 1), min(rows, y + 2)):
                for i in range(max(0, x - 1), min(cols, x + 2)):
                    if inside[j, i]:
                        n += 1
                        least = min(least, depth[j, i])
                        for k in range(3):
                            total[k] += base[j, i, k]
            if n > 0 and (depth[y, x] < 0 or depth[y, x] > 1.1 * least):
                for k in range(3):
                    out[y, x, k] = total[k] / n
    return out
