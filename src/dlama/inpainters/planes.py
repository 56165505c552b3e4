"""Planes of a view: inverse depth in; a few planes and, for every known pixel, which one it lies on, out.

A plane is affine in inverse depth over pixels, w = a u + b v + c (u, v in pixels, centres at 0.5), whatever the camera.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import BoolArray, Float32Array

SMOOTH = -1
"""Label of pixels on no plane."""
SKY = 0
"""Label of far pixels; planes count from 1."""
TOLERANCE = 0.012
"""Largest relative residual in inverse depth of a pixel that lies on a plane."""
NEIGHBOURHOOD = 9
"""Width in px of the window in which planes compete for a pixel."""
MOST_PLANES = 12
SMALLEST_SHARE = 0.01
"""Share of the known pixels that a plane must hold."""
HYPOTHESES = 160
SAMPLES = 9000
"""Known pixels that hypotheses are scored on."""


def find_planes(w: Float32Array, surface: BoolArray, seed: int) -> NDArray[np.float64]:
    """K x 3 planes (a, b, c), most supported first, K <= MOST_PLANES.

    Greedy RANSAC (Fischler & Bolles 1981) with local triples, each plane refined by least squares on its inliers.
    w: H x W inverse depth; surface: H x W, True where it is finite and known.
    """
    from dlama.inpainters import plane_kernels

    rows, columns = np.nonzero(surface)
    if len(rows) < 50:
        return np.zeros((0, 3))
    rng = np.random.default_rng(seed)
    chosen = np.sort(rng.choice(len(rows), min(SAMPLES, len(rows)), replace=False))
    u, v = columns[chosen] + 0.5, rows[chosen] + 0.5
    z = w[rows[chosen], columns[chosen]].astype(np.float64)
    free = np.ones(len(chosen), np.bool_)
    planes: list[np.ndarray] = []
    reach = 0.06 * max(w.shape)
    while len(planes) < MOST_PLANES and free.sum() > SMALLEST_SHARE * len(chosen):
        triples = plane_kernels.local_triples(u, v, free, reach, HYPOTHESES, int(rng.integers(2**31)))
        plane, support = plane_kernels.best_plane(u, v, z, free, triples, TOLERANCE)
        if support < SMALLEST_SHARE * len(chosen):
            break
        for _ in range(3):
            inliers = free & (np.abs(plane[0] * u + plane[1] * v + plane[2] - z) < TOLERANCE * z)
            if inliers.sum() < 12:
                break
            plane = fitted(u[inliers], v[inliers], z[inliers])
        free &= ~(np.abs(plane[0] * u + plane[1] * v + plane[2] - z) < 2 * TOLERANCE * z)
        planes.append(plane)
    return np.array(planes).reshape(-1, 3)


def fitted(u: np.ndarray, v: np.ndarray, w: np.ndarray) -> NDArray[np.float64]:
    """Least squares plane, residuals relative to w (so that far and near count alike)."""
    weight = 1 / w
    design = np.stack([u, v, np.ones_like(u)], 1) * weight[:, None]
    return np.asarray(np.linalg.lstsq(design, w * weight, rcond=None)[0], np.float64)


def plane_values(planes: NDArray[np.float64], hw: tuple[int, int], step: float = 1.0) -> Float32Array:
    """K x H x W inverse depth of the planes at pixel centres of a grid whose pixels are `step` view pixels wide."""
    u = (np.arange(hw[1]) + 0.5) * step
    v = (np.arange(hw[0]) + 0.5) * step
    a, b, c = (planes[:, k, None, None] for k in range(3))
    return (a * u + b * v[:, None] + c).astype(np.float32)


def label_known(w: Float32Array, surface: BoolArray, far: BoolArray, planes: NDArray[np.float64]) -> NDArray[np.int32]:
    """H x W int32: SKY at far pixels, k >= 1 on the k-th plane, SMOOTH elsewhere (holes too).

    Of the planes that fit a pixel it belongs to the one that fits most of its neighbourhood: a plane that merely cuts through
    a surface leaves no stripe on it.
    """
    import cv2

    window = (NEIGHBOURHOOD, NEIGHBOURHOOD)
    there = surface.astype(np.float32)
    most = 0.3 * cv2.boxFilter(there, -1, window, normalize=False)
    label = np.full(w.shape, SMOOTH, np.int32)
    for number, value in enumerate(planes):
        fits = surface & (np.abs(plane_values(value[None], w.shape)[0] - w) < TOLERANCE * w)
        count = cv2.boxFilter(fits.astype(np.float32), -1, window, normalize=False)
        better = fits & (count > most)
        most[better] = count[better]
        label[better] = number + 1
    label[far] = SKY
    return label
