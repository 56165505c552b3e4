"""Numba kernels for planes: hypotheses scored on samples, pixels labelled. Loaded only when planes are looked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Real, Whole, in_bands, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array


@kernel
def draw_triples(
    u: Float64Array, v: Float64Array, pool: NDArray[np.int64], reach: Real, seed: Whole, out: NDArray[np.int64]
) -> None:
    """Triples of `local_triples`. pool: indices of the free samples."""
    np.random.seed(seed)
    for number in range(len(out)):
        first = pool[np.random.randint(0, len(pool))]
        found = 1
        out[number, 0] = first
        for _ in range(200):
            other = pool[np.random.randint(0, len(pool))]
            if other == first or abs(u[other] - u[first]) > reach or abs(v[other] - v[first]) > reach:
                continue
            out[number, found] = other
            found += 1
            if found == 3:
                break


def local_triples(
    u: np.ndarray, v: np.ndarray, free: NDArray[np.bool_], reach: float, count: int, seed: int
) -> NDArray[np.int64]:
    """count x 3 indices of free samples that lie near each other (within `reach` px); -1 where none were found."""
    out = np.full((count, 3), -1, np.int64)
    draw_triples(u, v, np.flatnonzero(free), float(reach), seed, out)
    return out


@piece
def plane_through(
    u: Float64Array, v: Float64Array, w: Float64Array, i: Whole, j: Whole, k: Whole
) -> tuple[Real, Real, Real]:
    """(a, b, c) through three samples; zeros if they are on one line."""
    du1, dv1, dw1 = u[j] - u[i], v[j] - v[i], w[j] - w[i]
    du2, dv2, dw2 = u[k] - u[i], v[k] - v[i], w[k] - w[i]
    area = du1 * dv2 - du2 * dv1
    if abs(area) <= 4:
        return 0.0, 0.0, 0.0
    a = (dw1 * dv2 - dw2 * dv1) / area
    b = (du1 * dw2 - du2 * dw1) / area
    return a, b, w[i] - a * u[i] - b * v[i]


@kernel
def score_planes(
    first: Whole,
    last: Whole,
    u: Float64Array,
    v: Float64Array,
    w: Float64Array,
    free: BoolArray,
    triples: NDArray[np.int64],
    near: Float64Array,
    planes: Float64Array,
    support: NDArray[np.int64],
) -> None:
    """The planes through triples first..last, and how many free samples lie on each."""
    for number in range(first, last):
        if triples[number, 2] < 0:
            continue
        a, b, c = plane_through(u, v, w, triples[number, 0], triples[number, 1], triples[number, 2])
        planes[number, 0], planes[number, 1], planes[number, 2] = a, b, c
        if a == 0 and b == 0 and c == 0:
            continue
        inliers = 0
        for sample in range(len(u)):
            if free[sample]:
                residual = a * u[sample] + b * v[sample] + c - w[sample]
                inliers += abs(residual) < near[sample]
        support[number] = inliers


def best_plane(
    u: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
    free: NDArray[np.bool_],
    triples: NDArray[np.int64],
    near: np.ndarray,
) -> tuple[NDArray[np.float64], int]:
    """The hypothesis (a, b, c) with most inliers among the free samples, and how many; the first one wins a tie.

    near: for each sample, the residual below which it lies on a plane.
    """
    planes, support = np.zeros((len(triples), 3)), np.zeros(len(triples), np.int64)
    in_bands(score_planes, len(triples), u, v, w, free, triples, near, planes, support)
    best = int(np.argmax(support))
    return planes[best], int(support[best])


@kernel
def find_residuals(
    w: Float32Array,
    surface: BoolArray,
    near: Float32Array,
    plane: NDArray[np.float64],
    top: Whole,
    residual: Float32Array,
    fits: BoolArray,
) -> None:
    """How far inverse depth (H x W) is off a plane, and where that is less than `near` (H x W) on a surface
    (H x W). top: the picture's row that is the first here."""
    for row in range(len(w)):
        down = plane[1] * (top + row + 0.5)
        for column in range(w.shape[1]):
            value = np.float32(plane[0] * (column + 0.5) + down + plane[2])
            residual[row, column] = abs(value - w[row, column])
            fits[row, column] = surface[row, column] and residual[row, column] < near[row, column]
