"""Slow literal twin of hole typing: for every empty pixel, the highest rank among the stretched quads that cover it."""

from __future__ import annotations

import numpy as np

from reference.rasteriser import sides_of

MARGIN = 1e-3


def covers(corners: list[tuple[float, float]], px: float, py: float, grow: float) -> bool:
    """Is the point in the triangle (of either orientation), its barycentric coordinates loosened by `grow`?"""
    (x0, y0), (x1, y1), (x2, y2) = corners
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if abs(area) < 1e-9:
        return False
    one = ((px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)) / area
    two = ((x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)) / area
    return min(one, two, 1 - one - two) >= -grow


def ranks(
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    right: np.ndarray,
    down: np.ndarray,
    own: np.ndarray,
    near: float,
    crack_rank: int,
    hole: np.ndarray,
    grow: float,
) -> np.ndarray:
    """Ranks (0 = not covered) of the hole pixels; own: H x W of the source, rank of a pixel that is not there, else 0.

    A quad wholly before the near plane counts with the highest rank of its pixels; without one, as a crack where all its
    sides are joined and as a dis-occlusion (1) else.
    """
    quads = []
    for r in range(x.shape[0] - 1):
        for c in range(x.shape[1] - 1):
            quad = np.s_[r : r + 2, c : c + 2]
            if z[quad].min() > near:
                a, b, lower, d = zip(x[quad].ravel().tolist(), y[quad].ravel().tolist())
                of_surface = crack_rank if all(sides_of(right, down, r, c)) else 1
                quads.append(([a, b, lower], [b, d, lower], own[quad].max() or of_surface))
    out = np.zeros(hole.shape, np.uint8)
    for row, column in zip(*np.nonzero(hole)):
        point = column + 0.5, row + 0.5
        for upper_left, lower_right, rank in quads:
            if covers(upper_left, *point, grow) or covers(lower_right, *point, grow):
                out[row, column] = max(out[row, column], rank)
    return out
