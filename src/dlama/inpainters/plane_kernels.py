"""Numba kernels for planes: hypotheses scored on samples, pixels labelled. Loaded only when `layered` fills."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def local_triples(u, v, free, reach, count, seed):
    """count x 3 indices of free samples that lie near each other (within `reach` px); -1 where none were found."""
    np.random.seed(seed)
    pool = np.flatnonzero(free)
    out = np.full((count, 3), -1, np.int64)
    for number in range(count):
        first = pool[np.random.randint(len(pool))]
        found = 1
        out[number, 0] = first
        for _ in range(200):
            other = pool[np.random.randint(len(pool))]
            if other == first or abs(u[other] - u[first]) > reach or abs(v[other] - v[first]) > reach:
                continue
            out[number, found] = other
            found += 1
            if found == 3:
                break
    return out


@njit(cache=True)
def plane_through(u, v, w, i, j, k):
    """(a, b, c) through three samples; zeros if they are on one line."""
    du1, dv1, dw1 = u[j] - u[i], v[j] - v[i], w[j] - w[i]
    du2, dv2, dw2 = u[k] - u[i], v[k] - v[i], w[k] - w[i]
    area = du1 * dv2 - du2 * dv1
    plane = np.zeros(3)
    if abs(area) > 4:
        plane[0] = (dw1 * dv2 - dw2 * dv1) / area
        plane[1] = (du1 * dw2 - du2 * dw1) / area
        plane[2] = w[i] - plane[0] * u[i] - plane[1] * v[i]
    return plane


@njit(cache=True)
def best_plane(u, v, w, free, triples, tolerance):
    """The hypothesis with most inliers among the free samples, and how many; the first one wins a tie."""
    count = len(triples)
    support = np.zeros(count, np.int64)
    planes = np.zeros((count, 3))
    for number in range(count):
        if triples[number, 2] < 0:
            continue
        plane = plane_through(u, v, w, triples[number, 0], triples[number, 1], triples[number, 2])
        planes[number] = plane
        if plane[0] == 0 and plane[1] == 0 and plane[2] == 0:
            continue
        inliers = 0
        for sample in range(len(u)):
            if free[sample]:
                residual = plane[0] * u[sample] + plane[1] * v[sample] + plane[2] - w[sample]
                inliers += abs(residual) < tolerance * w[sample]
        support[number] = inliers
    best = np.argmax(support)
    return planes[best], support[best]
