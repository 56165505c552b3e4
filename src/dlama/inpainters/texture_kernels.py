"""Texture kernels: pixel grids in, trusted sources, shift scores, chosen shifts and painted pixels out (numba).

A *shift* (s1, s2) is a 3D translation within a plane; it moves a homogeneous pixel of inverse depth w to
p'_h = p_h + w (s1 E1 + s2 E2), with E = K e for two directions e of the plane.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

NEARER = np.float32(1.04)
"""A source may be this much nearer than expected; beyond it counts as an occluder."""
ROUGH = np.float32(1.2)
"""Within non-planar things (leaves) depth varies; only a neighbour this much nearer is another thing."""
FARTHER = np.float32(0.9)
"""And this much farther."""


@njit(cache=True)
def trusted_sources(hole, inverse_depth, label, reach):
    """Known pixels whose colour is their surface's own: no hole and no nearer surface within `reach` px."""
    height, width = hole.shape
    out = np.zeros((height, width), np.bool_)
    for y in range(height):
        for x in range(width):
            if hole[y, x]:
                continue
            kind, good = label[y, x], True
            own = inverse_depth[y, x] * NEARER + 1e-6
            rough = inverse_depth[y, x] * ROUGH + 1e-6
            for j in range(max(0, y - reach), min(height, y + reach + 1)):
                for i in range(max(0, x - reach), min(width, x + reach + 1)):
                    nearer = inverse_depth[j, i] > (own if label[j, i] != kind else rough)
                    if hole[j, i] or (nearer and (label[j, i] != kind or kind < 0)):
                        good = False
                if not good:
                    break
            out[y, x] = good
    return out


@njit(cache=True)
def shrink(color, inverse_depth, source, factor):
    """Blocks of factor x factor pixels: mean colour and inverse depth of the trusted pixels, and their label.

    source: H x W label of trusted pixels, -2 elsewhere. A block is -2 where labels mix or most pixels are not trusted.
    """
    height, width = source.shape
    rows, cols = (height + factor - 1) // factor, (width + factor - 1) // factor
    colors = np.zeros((rows, cols, 3), np.float32)
    depths = np.zeros((rows, cols), np.float32)
    sources = np.full((rows, cols), -2, np.int32)
    for r in range(rows):
        for c in range(cols):
            y1, x1 = min(height, (r + 1) * factor), min(width, (c + 1) * factor)
            red, green, blue, w, n, kind = 0.0, 0.0, 0.0, 0.0, 0, -2
            mixed = False
            for y in range(r * factor, y1):
                for x in range(c * factor, x1):
                    if source[y, x] == -2:
                        continue
                    mixed = mixed or (n > 0 and source[y, x] != kind)
                    kind = source[y, x]
                    red += color[y, x, 0]
                    green += color[y, x, 1]
                    blue += color[y, x, 2]
                    w += inverse_depth[y, x]
                    n += 1
            if n > 0 and not mixed and 2 * n >= (y1 - r * factor) * (x1 - c * factor):
                colors[r, c, 0], colors[r, c, 1], colors[r, c, 2] = red / n, green / n, blue / n
                depths[r, c] = w / n
                sources[r, c] = kind
    return colors, depths, sources


@njit(cache=True, inline="always")
def bilinear(grid, x, y, k):
    """Value of channel k of a grid at cell coordinates (x, y), cell centres at +0.5, clamped to the edge."""
    rows, cols = grid.shape[0], grid.shape[1]
    fx, fy = min(max(x - 0.5, 0.0), cols - 1.0), min(max(y - 0.5, 0.0), rows - 1.0)
    x0, y0 = int(fx), int(fy)
    x1, y1 = min(x0 + 1, cols - 1), min(y0 + 1, rows - 1)
    ax, ay = fx - x0, fy - y0
    top = grid[y0, x0, k] + ax * (float(grid[y0, x1, k]) - grid[y0, x0, k])
    low = grid[y1, x0, k] + ax * (float(grid[y1, x1, k]) - grid[y1, x0, k])
    return top + ay * (low - top)


@njit(cache=True)
def push(sums, weights, coarser, enough):
    """Cells with little weight take the coarser grid's value (bilinear), the others their own mean."""
    rows, cols = weights.shape
    out = np.zeros((rows, cols, 3), np.float32)
    for y in range(rows):
        for x in range(cols):
            own = min(1.0, weights[y, x] / enough)
            for k in range(3):
                value = 0.0
                if own < 1:
                    value = (1 - own) * bilinear(coarser, (x + 0.5) / 2, (y + 0.5) / 2, k)
                if own > 0:
                    value += own * sums[y, x, k] / weights[y, x]
                out[y, x, k] = value
    return out


@njit(cache=True, inline="always")
def moved(u, v, w, s1, s2, axes):
    """(u', v', z'): where a shift takes a pixel, and by how much its distance grows (z' <= 0: behind the camera)."""
    z = 1 + w * (s1 * axes[0, 2] + s2 * axes[1, 2])
    x = u + w * (s1 * axes[0, 0] + s2 * axes[1, 0])
    y = v + w * (s1 * axes[0, 1] + s2 * axes[1, 1])
    inv = 1 / z if z > 1e-3 else 0.0
    return x * inv, y * inv, z


@njit(cache=True, inline="always")
def is_source(u, v, expected, factor, depths, sources, kind):
    """Is the cell under full-resolution pixel (u, v) a trusted source of this surface at the expected inverse depth?"""
    x, y = int(np.floor(u / factor)), int(np.floor(v / factor))
    if x < 0 or y < 0 or x >= sources.shape[1] or y >= sources.shape[0] or sources[y, x] != kind:
        return False
    w = depths[y, x]
    return FARTHER * expected - 1e-6 <= w <= NEARER * expected + 1e-6


@njit(cache=True, parallel=True)
def correlate(shifts, points, detail, factor, depths, sources, kind, axes, need):
    """Correlation of the detail (cells x 3) at sample points and at their shifted places; 0 where too few are known.

    points: N x 3 (u, v, inverse depth), full-resolution pixels. Shrunk towards 0 for few samples.
    """
    out = np.zeros(len(shifts), np.float32)
    for i in prange(len(shifts)):
        ab, aa, bb, n = 0.0, 1e-3, 1e-3, 0
        for p in range(len(points)):
            u, v, w = points[p, 0], points[p, 1], points[p, 2]
            x, y, z = moved(u, v, w, shifts[i, 0], shifts[i, 1], axes)
            if z <= 1e-3 or not is_source(x, y, w / z, factor, depths, sources, kind):
                continue
            n += 1
            for k in range(3):
                a = bilinear(detail, u / factor, v / factor, k)
                b = bilinear(detail, x / factor, y / factor, k)
                ab += a * b
                aa += a * a
                bb += b * b
        if n >= need:
            out[i] = ab / np.sqrt(aa * bb) * n / (n + 12.0)
    return out


@njit(cache=True)
def change_of_scale(shifts, cells, factor, depths, sources, kind, axes):
    """For each shift and hole cell (u, v, w): -1 if its source is not known, else |log2| of the change of scale."""
    out = np.full((len(shifts), len(cells)), -1, np.float32)
    for i in range(len(shifts)):
        for p in range(len(cells)):
            u, v, w = cells[p, 0], cells[p, 1], cells[p, 2]
            x, y, z = moved(u, v, w, shifts[i, 0], shifts[i, 1], axes)
            if z > 1e-3 and is_source(x, y, w / z, factor, depths, sources, kind):
                out[i, p] = abs(np.log2(z)) + (0.3 * max(0.0, np.log2(z)))
    return out


@njit(cache=True)
def assign(index, cost, lateral, order, seam, sweeps):
    """Choose one shift per hole cell: own cost plus seams to the neighbours' choices (ordered fill, then sweeps).

    index: rows x cols, cell number or -1 (not a hole cell of this surface); cost: cells x shifts (>= 1e6: impossible);
    lateral: cells x shifts x 3, the colour detail each shift would bring. Returns cells, int32, -1 where none is possible.
    """
    rows, cols = index.shape
    number, many = cost.shape
    chosen = np.full(number, -1, np.int32)
    for sweep in range(sweeps):
        for o in range(number):
            cell = order[o] if sweep % 2 == 0 else order[number - 1 - o]
            y, x = 0, 0
            y, x = cell // cols, cell % cols
            p = index[y, x]
            best, least = -1, 1e6
            for i in range(many):
                total = cost[p, i]
                if total >= least:
                    continue
                for d in range(4):
                    yy = y + (d == 0) - (d == 1)
                    xx = x + (d == 2) - (d == 3)
                    if yy < 0 or xx < 0 or yy >= rows or xx >= cols or index[yy, xx] < 0:
                        continue
                    q = index[yy, xx]
                    j = chosen[q]
                    if j < 0 or j == i:
                        continue
                    total += 0.15
                    if cost[q, i] < 1e6 and cost[p, j] < 1e6:
                        gap = 0.0
                        for k in range(3):
                            gap += abs(lateral[p, i, k] - lateral[p, j, k]) + abs(lateral[q, i, k] - lateral[q, j, k])
                        total += seam * gap
                    else:
                        total += 0.3
                if total < least:
                    best, least = i, total
            chosen[p] = best
    return chosen


@njit(cache=True, parallel=True)
def paint(out, color, pixels, inverse_depth, source, kind, axes, bases, cell, pick, gains, shifts):
    """Colour the listed flat pixels of `out` in place, feathered between the shifts that neighbouring cells picked.

    bases: (true to the rim, very smooth), rows x cols x 3 grids of `cell`-pixel cells; pick: rows x cols, shift or -1;
    gains: rows x cols x 3, how much of the fine band, the middle band and the copied colour as it stands is believed.
    """
    width = out.shape[1]
    fine, smooth = bases
    for n in prange(len(pixels)):
        y, x = pixels[n] // width, pixels[n] % width
        u, v, w = x + 0.5, y + 0.5, inverse_depth[y, x]
        gu, gv = u / cell, v / cell
        x0, y0 = int(np.floor(gu - 0.5)), int(np.floor(gv - 0.5))
        ax, ay = gu - 0.5 - x0, gv - 0.5 - y0
        added, total = np.zeros(3), 0.0
        for d in range(4):
            cx, cy = x0 + (d & 1), y0 + (d >> 1)
            share = (ax if d & 1 else 1 - ax) * (ay if d >> 1 else 1 - ay)
            if share <= 0 or cx < 0 or cy < 0 or cx >= pick.shape[1] or cy >= pick.shape[0] or pick[cy, cx] < 0:
                continue
            i = pick[cy, cx]
            su, sv, z = moved(u, v, w, shifts[i, 0], shifts[i, 1], axes)
            if z <= 1e-3 or not is_source(su, sv, w / z, 1, inverse_depth, source, kind):
                continue
            total += share
            for k in range(3):
                low = bilinear(fine, su / cell, sv / cell, k)
                middle = low - bilinear(smooth, su / cell, sv / cell, k)
                middle += bilinear(smooth, gu, gv, k) - bilinear(fine, gu, gv, k)
                copied = bilinear(color, su, sv, k)
                banded = gains[cy, cx, 0] * (copied - low) + gains[cy, cx, 1] * middle
                plain = copied - bilinear(fine, gu, gv, k)
                added[k] += share * (banded + gains[cy, cx, 2] * (plain - banded))
        for k in range(3):
            value = bilinear(fine, gu, gv, k) + (added[k] / total if total > 0 else 0.0)
            out[y, x, k] = np.uint8(min(max(value + 0.5, 0.0), 255.0))
