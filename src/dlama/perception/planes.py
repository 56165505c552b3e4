"""Inverse depth of a view in; its few planes and the plane label of every known pixel out.

A plane is affine in inverse depth over pixels, w = a u + b v + c (u, v in pixels, centres at 0.5), for any camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.depth_noise import REACH, deviation, second_differences
from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.perception.kernels import planes as plane_kernels

SMOOTH = -1
"""Label of pixels on no plane."""
SKY = 0
"""Label of far pixels; planes count from 1."""
TOLERANCE = 0.012
"""Largest relative residual in inverse depth of a pixel that lies on a plane."""
NOISE_FACTOR = 2.5
"""The same in units of the noise of inverse depth (stereo matching, structured light); the larger one counts."""
ESTIMATED_NOISE = 0.02
"""Relative error of estimated inverse depth with which its planes are fitted."""
OUTLIER_FACTOR = 2.0
"""Multiple of that residual up to which a pixel amid inliers is one, too: matching errs in patches, not by a Gaussian."""
NEIGHBOURHOOD = 9
"""Width in px of the window in which planes compete for a pixel."""
MOST_PLANES = 12
"""Largest number of planes: a label is a byte."""
BAND = 128
"""Rows that are worked on at a time."""


@dataclass(frozen=True, eq=False)
class KnownSurfaces:
    """The surfaces that the known pixels of a view lie on."""

    inverse_depth: Float32Array
    """H x W, 1/m; 0 = far or unknown; on planes without noise."""
    label: NDArray[np.int8]
    """H x W, as of `label_known`."""
    planes: NDArray[np.float64]
    """K x 3, as of `find_planes`."""
    noise: float = 0.0
    """As of `noise_level`."""

    @classmethod
    def of(cls, w: Float32Array, surface: BoolArray, far: BoolArray, seed: int) -> KnownSurfaces:
        """Of inverse depth (H x W), which is finite in the pixels of `surface` (H x W) and 0 in those of `far` (H x W); the same
        seed finds the same planes."""
        noise = noise_level(w, surface)
        planes = find_planes(w, surface, seed, noise)
        label = label_known(w, surface, far, planes, noise)
        return cls(denoise(w, label, planes, noise), label, planes, noise)


def noise_level(w: Float32Array, surface: BoolArray) -> float:
    """Standard deviation (1/m) of the noise of measured inverse depth; 0 where it is exact.

    Measured as the median second difference (`geometry.depth_noise`). Noise below the tolerance at the median distance counts as
    none. Of a picture of more than a megapixel every n-th row and column is read.
    """
    step = math.ceil(w.size / (1 << 20))
    lines = (w[::step], surface[::step]), (w[:, ::step].T, surface[:, ::step].T)
    bends = np.concatenate([second_differences(*each, REACH)[0] for each in lines])
    level = w[::step][surface[::step]]
    noise = deviation(bends) if bends.size and level.size else 0.0
    return noise if noise and NOISE_FACTOR * noise > TOLERANCE * float(np.median(level)) else 0.0


def tolerance(w: np.ndarray, noise: float) -> np.ndarray:
    """Largest residual in inverse depth of a pixel that lies on a plane, for each w."""
    return np.maximum(w.dtype.type(TOLERANCE) * w, w.dtype.type(NOISE_FACTOR * noise))


def find_planes(w: Float32Array, surface: BoolArray, seed: int, noise: float = 0.0) -> NDArray[np.float64]:
    """K x 3 planes (a, b, c), most supported first, K <= MOST_PLANES, each of a hundredth of the known pixels at least.

    Greedy RANSAC (Fischler & Bolles 1981) with 160 local triples a plane, scored on 9000 pixels and refined by least squares.
    w: H x W inverse depth; surface: H x W, True where it is finite and known; noise: as `noise_level` gives it.
    """
    places = np.flatnonzero(surface)
    if len(places) < 50:
        return np.zeros((0, 3))
    rng = np.random.default_rng(seed)
    chosen = np.sort(rng.choice(len(places), min(9000, len(places)), replace=False))
    rows, columns = np.divmod(places[chosen], w.shape[1])
    u, v = columns + 0.5, rows + 0.5
    z = w[rows, columns].astype(np.float64)
    near = tolerance(z, noise)
    free = np.ones(len(chosen), np.bool_)
    planes: list[np.ndarray] = []
    reach, least = 0.06 * max(w.shape), 0.01 * len(chosen)
    while len(planes) < MOST_PLANES and free.sum() > least:
        triples = plane_kernels.local_triples(u, v, free, reach, 160, int(rng.integers(2**31)))
        plane, support = plane_kernels.best_plane(u, v, z, free, triples, near)
        if support < least:
            break
        for _ in range(3):
            inliers = free & (np.abs(plane[0] * u + plane[1] * v + plane[2] - z) < near)
            if inliers.sum() < 12:
                break
            plane = fit_plane(u[inliers], v[inliers], z[inliers], near[inliers])
        free &= ~(np.abs(plane[0] * u + plane[1] * v + plane[2] - z) < 2 * near)
        planes.append(plane)
    return np.array(planes).reshape(-1, 3)


def fit_plane(u: np.ndarray, v: np.ndarray, w: np.ndarray, near: np.ndarray) -> NDArray[np.float64]:
    """(a, b, c) by least squares, residuals relative to `near`, the largest allowed (far and near count alike)."""
    weight = TOLERANCE / near
    design = np.stack([u, v, np.ones_like(u)], 1) * weight[:, None]
    return np.asarray(np.linalg.lstsq(design, w * weight, rcond=None)[0], np.float64)


def plane_normal(plane: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """3: the normal, in camera axes, of a plane w = a u + b v + c; its length is 1 over the camera's distance from it (1/m)."""
    return np.asarray(plane @ camera.K)


def plane_values(planes: NDArray[np.float64], hw: tuple[int, int], step: float = 1.0) -> Float32Array:
    """K x H x W inverse depth of the planes at pixel centres of a grid, whose pixels are `step` view pixels wide."""
    u = (np.arange(hw[1]) + 0.5) * step
    v = (np.arange(hw[0]) + 0.5) * step
    a, b, c = (planes[:, k, None, None] for k in range(3))
    return np.asarray(a * u + b * v[:, None] + c, np.float32)


def label_known(
    w: Float32Array, surface: BoolArray, far: BoolArray, planes: NDArray[np.float64], noise: float = 0.0
) -> NDArray[np.int8]:
    """H x W int8: SKY at far pixels, k >= 1 on the k-th plane, SMOOTH elsewhere (holes too).

    Of the planes that fit a pixel it takes the one that fits most of its neighbourhood: a plane that merely intersects a
    surface leaves no stripe on it.
    """
    label = np.empty(w.shape, np.int8)

    def label_rows(first: int, last: int) -> None:
        top, bottom = max(first - NEIGHBOURHOOD, 0), min(last + NEIGHBOURHOOD, len(w))
        found = _label_known(w[top:bottom], surface[top:bottom], planes, noise, top)
        label[first:last] = found[first - top : last - top]

    in_bands(label_rows, len(w), band=BAND)
    label[far] = SKY
    return label


def _label_known(
    w: Float32Array, surface: BoolArray, planes: NDArray[np.float64], noise: float, top: int
) -> NDArray[np.int8]:
    """`label_known` of some rows, from the row `top` on, without far pixels."""
    most = np.float32(0.3) * count_around(surface)
    near, half = tolerance(w, noise), np.float32(0.5) * count_around(surface)
    label = np.full(w.shape, SMOOTH, np.int8)
    residual, fits = np.empty_like(w), np.empty_like(surface)
    for number, plane in enumerate(planes):
        plane_kernels.find_residuals(as_input(w), as_input(surface), near, as_input(plane), top, residual, fits)
        if not fits.any():
            continue
        count = count_around(fits)
        if noise:
            fits |= surface & (residual < OUTLIER_FACTOR * NOISE_FACTOR * noise) & (count > half)
        better = fits & (count > most)
        np.copyto(most, count, where=better)
        np.copyto(label, np.int8(number + 1), where=better)
    return label


def count_around(where: BoolArray) -> Float32Array:
    """H x W: how many of `where` (H x W) lie in the square of NEIGHBOURHOOD px round each pixel."""
    window = (NEIGHBOURHOOD, NEIGHBOURHOOD)
    return np.asarray(cv2.boxFilter(where.view(np.uint8), cv2.CV_32F, window, normalize=False), np.float32)


def plane_values_at(
    planes: NDArray[np.float64], label: NDArray[np.int8], rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> NDArray[np.float64]:
    """N inverse depths (1/m) of the labelled planes at the centres of N pixels; 0 for labels of no plane.

    The value is negative where the plane lies behind the camera.
    """
    of_label = np.concatenate([np.zeros((1, 3)), planes])[np.maximum(label, 0)]
    return np.asarray(of_label[:, 0] * (columns + 0.5) + of_label[:, 1] * (rows + 0.5) + of_label[:, 2], np.float64)


def denoise(w: Float32Array, label: NDArray[np.int8], planes: NDArray[np.float64], noise: float) -> Float32Array:
    """H x W inverse depth without the noise on planes; of residuals above the noise limit, the excess stays."""
    if not noise or not len(planes):
        return w
    out = w.copy()

    def denoise_rows(first: int, last: int) -> None:
        rows, columns = np.nonzero(label[first:last] > SKY)
        rows += first
        on_plane = plane_values_at(planes, label[rows, columns], rows, columns)
        residual = w[rows, columns] - on_plane
        excess = np.maximum(np.abs(residual) - OUTLIER_FACTOR * NOISE_FACTOR * noise, 0)
        out[rows, columns] = on_plane + np.sign(residual) * excess

    in_bands(denoise_rows, len(w), band=BAND)
    return out
