"""Slow literal twin of the kernels of surface colours: grids in; trusted sources, means, sums and relaxed cells out."""

from __future__ import annotations

import itertools
import math

import numpy as np

NEIGHBOURS = ((1, 0), (-1, 0), (0, 1), (0, -1))


def trusted_sources(hole, inverse_depth, label, reach):
    """True where neither a hole nor a nearer surface lies in the (2 reach + 1)^2 window."""
    out = ~hole
    for y, x in zip(*np.nonzero(~hole)):
        window = np.s_[max(0, y - reach) : y + reach + 1, max(0, x - reach) : x + reach + 1]
        w, other = inverse_depth[window], label[window] != label[y, x]
        nearer = other & (w > inverse_depth[y, x] * np.float32(1.04) + 1e-6)
        if label[y, x] < 0:
            nearer |= ~other & (w > inverse_depth[y, x] * np.float32(1.2) + 1e-6)
        out[y, x] = not (hole[window] | nearer).any()
    return out


def shrink(color, inverse_depth, source, factor):
    """Block means over trusted pixels; a block counts if at least half are trusted, all with one label."""
    rows, cols = (math.ceil(n / factor) for n in source.shape)
    colors, depths = np.zeros((rows, cols, 3)), np.zeros((rows, cols))
    sources = np.full((rows, cols), -2)
    for r, c in itertools.product(range(rows), range(cols)):
        block = np.s_[r * factor : (r + 1) * factor, c * factor : (c + 1) * factor]
        good = source[block] != -2
        if good.any() and len(np.unique(source[block][good])) == 1 and 2 * good.sum() >= good.size:
            colors[r, c] = color[block][good].mean(0)
            depths[r, c] = inverse_depth[block][good].mean()
            sources[r, c] = source[block][good][0]
    return colors, depths, sources


def pull(sums, weights):
    """Sums over 2 x 2 blocks of a zero-padded grid."""
    pad = [(0, n % 2) for n in weights.shape]
    sums, weights = np.pad(sums, [*pad, (0, 0)]), np.pad(weights, pad)
    return (sum(a[i::2, j::2] for i in (0, 1) for j in (0, 1)) for a in (sums, weights))


def neighbours(y, x, shape):
    """The up to four cells next to (y, x)."""
    return [(y + j, x + i) for j, i in NEIGHBOURS if 0 <= y + j < shape[0] and 0 <= x + i < shape[1]]


def relax(base, usable, cells, mean, screen, sweeps):
    """Gauss-Seidel with over-relaxation 1.6, forwards and backwards in turn."""
    base = base.astype(float)
    for sweep in range(sweeps):
        for cell in cells if sweep % 2 == 0 else cells[::-1]:
            y, x = divmod(int(cell), usable.shape[1])
            next_to = [base[q] for q in neighbours(y, x, usable.shape) if usable[q]]
            goal = (sum(next_to) + screen * mean) / (len(next_to) + screen)
            base[y, x] += 1.6 * (goal - base[y, x])
    return base
