"""Slow literal twins of the extension kernels: rays one step at a time, and every labelling of a small grid tried out."""

from __future__ import annotations

import itertools
import math

import numpy as np

NEIGHBOURS = ((0, 1), (1, 0), (0, -1), (-1, 0))


def met(w: np.ndarray, hole: np.ndarray, row: int, column: int, angle: float) -> tuple[float, int] | None:
    """Inverse depth of the first known pixel in a direction and the number of unit steps to it; None beyond the border."""
    for steps in itertools.count(1):
        y, x = row + 0.5 + steps * math.sin(angle), column + 0.5 + steps * math.cos(angle)
        if not (0 <= y < w.shape[0] and 0 <= x < w.shape[1]):
            return None
        if not hole[int(y), int(x)]:
            return float(w[int(y), int(x)]), steps
    return None


def far_mean(found: list[tuple[float, int]]) -> float:
    """Weights 1 / distance; the weighted first quartile from the far end; mean of all up to 1.3 times it, weights squared."""
    found = sorted(found, key=lambda one: one[0])
    quarter = 0.25 * sum(1 / steps for _, steps in found)
    reached = np.cumsum([1 / steps for _, steps in found])
    limit = found[int(np.argmax(reached >= quarter))][0]
    kept = [(value, steps**-2) for value, steps in found if value <= 1.3 * limit]
    return sum(value * weight for value, weight in kept) / sum(weight for _, weight in kept)


def far_side(w: np.ndarray, hole: np.ndarray, directions: int = 16) -> np.ndarray:
    """Holes interpolated from the far side of their rims; 0 elsewhere, and where no finite rim is met."""
    out = np.zeros(w.shape)
    for row, column in zip(*np.nonzero(hole)):
        hits = [met(w, hole, row, column, 2 * math.pi * k / directions) for k in range(directions)]
        found = [hit for hit in hits if hit is not None and hit[0] > 0]
        if found:
            out[row, column] = far_mean(found)
    return out


def rim_cost(value: float, label: int, known: float, known_label: int, rim: tuple[float, ...]) -> float:
    """What a neighbour of a known pixel pays: nothing if it continues, else for meeting it, and for the step between them,
    by who is in front: nothing more up to 3 %, in full from 13 % on."""
    meets, hidden, sky_hidden, in_front = rim
    if label == known_label != -1:
        return 0.0
    near, far = max(value, known), min(value, known)
    step = near / far - 1 if far > 0 else (math.inf if near > 0 else 0.0)
    full = in_front if value > known else sky_hidden if label == 0 else hidden
    return meets + full * min(max((step - 0.03) / 0.1, 0.0), 1.0)


def unary(
    values: np.ndarray,
    allowed: np.ndarray,
    distance: np.ndarray,
    hole: np.ndarray,
    w: np.ndarray,
    label: np.ndarray,
    scale: float,
    penalty: np.ndarray,
    rim: tuple[float, ...],
) -> np.ndarray:
    """H x W x L cost of every label at every hole pixel."""
    out = np.zeros((*hole.shape, len(values)))
    for row, column, k in np.ndindex(*out.shape):
        if not hole[row, column]:
            continue
        out[row, column, k] = penalty[k, row, column] + 50.0 * (not allowed[k, row, column])
        out[row, column, k] += (distance[k, row, column] - distance[:, row, column].min()) / scale
        for dr, dc in NEIGHBOURS:
            r, c = row + dr, column + dc
            if 0 <= r < hole.shape[0] and 0 <= c < hole.shape[1] and not hole[r, c]:
                out[row, column, k] += rim_cost(values[k, row, column], k - 1, w[r, c], label[r, c], rim)
    return out


def pair(k: int, value: float, other: int, other_value: float, potts: float) -> float:
    """Two neighbours: free for one label, `potts` for two that meet, up to 1 more for two that jump (in full at 10 %)."""
    if k == other:
        return 0.0
    return potts + min(1.0, abs(value - other_value) / max(value, other_value, 1e-9) / 0.1)


def min_marginals(unary: np.ndarray, values: np.ndarray, hole: np.ndarray, potts: float) -> np.ndarray:
    """H x W x L: the least total cost of any labelling of the hole in which that pixel has that label; 0 outside the hole.

    Every labelling is tried: for a handful of pixels and labels only.
    """
    pixels = list(zip(*np.nonzero(hole)))
    edges = [
        (i, j)
        for i, (r, c) in enumerate(pixels)
        for j, (s, d) in enumerate(pixels)
        if (s, d) in ((r, c + 1), (r + 1, c))
    ]
    out = np.where(hole[..., None], np.full(unary.shape, np.inf), 0.0)
    for labels in itertools.product(range(unary.shape[2]), repeat=len(pixels)):
        cost = sum(unary[r, c, k] for (r, c), k in zip(pixels, labels))
        for i, j in edges:
            a, b = (values[labels[n], pixels[n][0], pixels[n][1]] for n in (i, j))
            cost += pair(labels[i], a, labels[j], b, potts)
        for (r, c), k in zip(pixels, labels):
            out[r, c, k] = min(out[r, c, k], cost)
    return out
