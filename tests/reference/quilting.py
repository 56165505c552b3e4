"""Slow literal twin of the quilting kernel: a picture with undecided pixels in; what each is copied from out."""

from __future__ import annotations

import itertools

import numpy as np


def quilted(state, color, places, corners, own, tried, there, side, stride, scale, rim):
    """Two rounds over the places: of the blocks tried, the one least unlike what is decided; first within `rim`, then all."""
    out = state.copy()
    pixels = list(itertools.product(range(side), range(side)))
    inside = {t: [(j, i) for j, i in pixels if in_picture(out, y + j, x + i)] for t, (y, x) in enumerate(places)}
    for last, (t, (y, x)) in itertools.product((False, True), list(enumerate(places))):
        if not any(out[y + j, x + i] == -2 for j, i in inside[t]):
            continue
        top, left = max(-y, 0), max(-x, 0)
        compared = [(j, i) for j, i in inside[t] if (j - top) % stride == 0 and (i - left) % stride == 0]
        costs = []
        for n in tried[t]:
            each = [
                unlike(out[y + j, x + i], out[corners[n][0] + j, corners[n][1] + i], color, scale) for j, i in compared
            ]
            each = [value for value in each if value is not None]
            costs.append(sum(each) / (len(each) + 1e-6) + ((own[t] - there[n]).astype(float) ** 2).sum())
        best = corners[tried[t][int(np.argmin(costs))]]
        for j, i in inside[t]:
            away = max(abs(2 * j - side), abs(2 * i - side)) / side
            if out[y + j, x + i] == -2 and (last or away < rim[y + j, x + i]):
                out[y + j, x + i] = out[best[0] + j, best[1] + i]
    return out


def in_picture(out, y, x):
    return 0 <= y < out.shape[0] and 0 <= x < out.shape[1]


def unlike(here, other, color, scale):
    """None where nothing is decided, 1 for a leaf where a gap should be, else the squared step of colours over the scale."""
    if here < -1:
        return None
    if (here < 0) != (other < 0):
        return 1.0
    if here < 0:
        return 0.0
    first, second = (color.reshape(-1, 3)[n].astype(float) for n in (here, other))
    return (((first - second) / scale) ** 2).sum()
