"""Numba kernels that extend surfaces into holes: far-side interpolation, and belief propagation over surface labels."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

DIRECTIONS = 16
SKY_LABEL = 0


@njit(cache=True)
def first_known(w, hole, row, column, dr, dc):
    """Inverse depth and distance of the first known pixel from a hole pixel in a direction; -1 if there is none."""
    height, width = w.shape
    steps = 0
    y, x = row + 0.5, column + 0.5
    while True:
        y += dr
        x += dc
        steps += 1
        if not (0 <= y < height and 0 <= x < width):
            return -1.0, 0.0
        if not hole[int(y), int(x)]:
            return w[int(y), int(x)], float(steps)


@njit(cache=True, parallel=True)
def far_side(w, hole):
    """Inverse depth of the holes interpolated from the far side of their rims only; 0 where no rim is in sight.

    From each hole pixel 16 rays look for the rim; the farthest quarter of what they meet (weighted by nearness) and all
    within 30 % of it counts, by inverse square distance. Far pixels (w = 0) are left out: the sky has its own label.
    """
    height, width = w.shape
    out = np.zeros((height, width), np.float32)
    for row in prange(height):
        values = np.empty(DIRECTIONS)
        weights = np.empty(DIRECTIONS)
        for column in range(width):
            if not hole[row, column]:
                continue
            count = 0
            for direction in range(DIRECTIONS):
                angle = 2 * math.pi * direction / DIRECTIONS
                value, distance = first_known(w, hole, row, column, math.sin(angle), math.cos(angle))
                if value > 0:
                    values[count] = value
                    weights[count] = 1.0 / distance
                    count += 1
            if count:
                out[row, column] = far_mean(values[:count], weights[:count])
    return out


@njit(cache=True)
def far_mean(values, weights):
    """Mean of the values near their weighted first quartile, weights squared."""
    order = np.argsort(values)
    total, reached = weights.sum(), 0.0
    limit = values[order[0]]
    for number in order:
        reached += weights[number]
        limit = values[number]
        if reached >= 0.25 * total:
            break
    top, bottom = 0.0, 0.0
    for number in range(len(values)):
        if values[number] <= 1.3 * limit:
            top += values[number] * weights[number] ** 2
            bottom += weights[number] ** 2
    return top / bottom


@njit(cache=True)
def rim_cost(value, label, known, known_label, rim):
    """Cost of filling `value` (inverse depth) with `label` next to a known pixel: going on is free, to be hidden by the
    known pixel is cheap (less so for the sky), to stand before it is dear. rim: (meets, hidden, sky hidden, in front)."""
    if label == known_label and label >= 0:
        return 0.0
    if value > known:  # noise of a few per cent is no step
        return rim[0] + rim[3] * min(1.0, max(0.0, value / max(known, 1e-9) - 1.03) / 0.1)
    hidden = rim[2] if label == SKY_LABEL else rim[1]
    return rim[0] + hidden * min(1.0, max(0.0, known / max(value, 1e-9) - 1.03) / 0.1)


@njit(cache=True)
def unary_costs(values, allowed, distance, hole, w, label, scale, penalty, rim):
    """H x W x L cost of each label at each hole pixel: how far away the surface was last seen, and the rim.

    values: L x H x W inverse depth; allowed: L x H x W bool; distance: L x H x W px to the nearest known pixel of a label;
    scale: px of distance that cost as much as one full jump; penalty: L x H x W further cost. Label l is `l - 1` in `label`.
    """
    count, height, width = values.shape
    out = np.zeros((height, width, count), np.float32)
    for row in range(height):
        for column in range(width):
            if not hole[row, column]:
                continue
            nearest = np.inf
            for k in range(count):
                nearest = min(nearest, distance[k, row, column])
            for k in range(count):
                cost = penalty[k, row, column] + (distance[k, row, column] - nearest) / scale
                if not allowed[k, row, column]:
                    cost += 50.0
                for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
                    r, c = row + dr, column + dc
                    if 0 <= r < height and 0 <= c < width and not hole[r, c]:
                        cost += rim_cost(values[k, row, column], k - 1, w[r, c], label[r, c], rim)
                out[row, column, k] = cost
    return out


@njit(cache=True)
def pair_cost(value, other, potts):
    """Cost between two different labels of neighbouring hole pixels: `potts` where their surfaces meet, 1 more at a jump
    of 10 % and above."""
    gap = abs(value - other) / max(max(value, other), 1e-9)
    return potts + min(1.0, gap / 0.1)


@njit(cache=True)
def send(unary, messages, values, hole, potts, row, column, to_row, to_column, incoming, outgoing):
    """One min-sum message from a hole pixel to its neighbour; `incoming` is the direction it must not echo."""
    count = unary.shape[2]
    if not (hole[row, column] and hole[to_row, to_column]):
        return
    belief = np.empty(count)
    for k in range(count):
        belief[k] = unary[row, column, k]
        for direction in range(4):
            if direction != incoming:
                belief[k] += messages[direction, row, column, k]
    smallest = np.inf
    for k in range(count):
        best = belief[k]
        for other in range(count):
            if other != k and belief[other] < best:
                cost = belief[other] + pair_cost(values[other, row, column], values[k, to_row, to_column], potts)
                best = min(best, cost)
        messages[outgoing, to_row, to_column, k] = best
        smallest = min(smallest, best)
    for k in range(count):
        messages[outgoing, to_row, to_column, k] -= smallest


@njit(cache=True)
def sweep_rows(unary, messages, values, hole, potts):
    """Messages to the right and to the left along every row (directions 0 from left, 1 from right)."""
    height, width = hole.shape
    for row in range(height):
        for column in range(width - 1):
            send(unary, messages, values, hole, potts, row, column, row, column + 1, 1, 0)
        for column in range(width - 1, 0, -1):
            send(unary, messages, values, hole, potts, row, column, row, column - 1, 0, 1)


@njit(cache=True)
def sweep_columns(unary, messages, values, hole, potts):
    """Messages down and up along every column (directions 2 from above, 3 from below)."""
    height, width = hole.shape
    for column in range(width):
        for row in range(height - 1):
            send(unary, messages, values, hole, potts, row, column, row + 1, column, 3, 2)
        for row in range(height - 1, 0, -1):
            send(unary, messages, values, hole, potts, row, column, row - 1, column, 2, 3)


def beliefs(unary, values, hole, potts, rounds):
    """H x W x L min-marginals by loopy belief propagation (sequential sweeps along rows and columns)."""
    messages = np.zeros((4, *unary.shape), np.float32)
    for _ in range(rounds):
        sweep_rows(unary, messages, values, hole, potts)
        sweep_columns(unary, messages, values, hole, potts)
    return unary + messages.sum(0)
