"""Two views of one scene in; the agreement of their depths and colours, sample by sample, out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.frames.choosing import sample_view
from dlama.geometry.frames.stored import Layer
from dlama.geometry.projection import inverse_depth, project
from dlama.geometry.rgbd import Float32Array
from dlama.geometry.view import View

AGREES = 0.05
"""Largest relative difference of two depths of one surface, at any noise and pose error."""
UNCLIPPED = (8, 247)
"""Levels between which a channel is used for the gain of a picture."""
SAME_GAIN = 0.01
"""A gain nearer to 1 than this is none: rounding would cost more than it mends."""
ENOUGH = 20
"""Least number of common samples of a pair of frames."""
ALL_PAIRS = 64
"""Most frames for which all pairs are compared; beyond, each with those 1, 2, 4, 8, ... places on."""


@dataclass(frozen=True)
class Overlap:
    """One frame's samples reprojected to another frame."""

    agree: int
    """Samples that lie on the other's surface."""
    through: int
    """Samples that the other frame saw through: it measured a surface behind them."""
    depth: Float64Array
    """Of the samples that agree: metres."""
    error: Float64Array
    """Their depth in the other frame less what that measured."""
    ratio: Float64Array
    """N x 3: logarithm of the other's colour by this one's, of samples that neither clips."""

    def thin(self, every: int) -> Overlap:
        """With every n-th sample; the counts stay."""
        some = {name: getattr(self, name)[::every] for name in ("depth", "error", "ratio")}
        return dataclasses.replace(self, **some)


def make_comparable(layer: Layer) -> tuple[Float64Array, Float32Array]:
    """N x 3 points of a frame's samples, and their colours, small enough to be kept for all frames at once."""
    samples = layer.find_once(sample_view)
    return samples.points, blur(layer.load())[samples.rows, samples.columns]


def blur(view: View) -> Float32Array:
    """H x W x 3, mean colours round each pixel: poses are off by one or two."""
    return cv2.blur(view.color, (5, 5)).astype(np.float32)


def frame_pairs(count: int) -> list[tuple[int, int]]:
    """Pairs of frames (i, j), i != j, to compare, both ways."""
    if count <= ALL_PAIRS:
        return [(i, j) for i in range(count) for j in range(count) if i != j]
    steps = [2**power for power in range(count.bit_length()) if 2**power < count]
    one_way = [(i, i + step) for i in range(count) for step in steps if i + step < count]
    return [*one_way, *((j, i) for i, j in one_way)]


def measure_overlaps(views: Sequence[Layer]) -> dict[tuple[int, int], Overlap]:
    """Overlap of each pair of `frame_pairs`: (i, j) -> the samples of i seen by j. Each frame's pixels are read twice."""
    pairs = frame_pairs(len(views))
    every = max(1, len(pairs) // ALL_PAIRS**2)  # of more pairs every second, third, ... sample is kept
    ready = [view.find_once(make_comparable) for view in views]
    seen_by: dict[int, list[int]] = {}
    for i, j in pairs:
        seen_by.setdefault(j, []).append(i)
    found = {}
    for j, places in sorted(seen_by.items()):
        view = views[j].load()
        pictures = blur(view), inverse_depth(view.known_depth)
        for i in places:
            found[i, j] = measure_overlap(*ready[i], view.camera, *pictures).thin(every)
    return {pair: found[pair] for pair in pairs}


def measure_overlap(
    points: Float64Array, colors: Float32Array, camera: Camera, blurred: Float32Array, inverse: Float32Array
) -> Overlap:
    """A frame's samples (`make_comparable`) seen by another one, of which the mean colours and the inverse depth are given."""
    pixels, z = project(points, camera)
    inside = (z > 0) & (pixels >= 0.5).all(1) & (pixels < np.array(camera.wh) - 0.5).all(1)
    pixels, z = pixels[inside], z[inside]
    w = sample_inverse_depth(inverse, pixels)
    known = w > 0
    pixels, z, w = pixels[known], z[known], w[known]
    agree = np.abs(z * w - 1) <= AGREES
    x, y = pixels[agree].astype(np.intp).T
    here, there = colors[inside][known][agree], blurred[y, x]
    clear = (np.minimum(here, there) > UNCLIPPED[0]).all(1) & (np.maximum(here, there) < UNCLIPPED[1]).all(1)
    return Overlap(
        int(agree.sum()),
        int((z * w < 1 - AGREES).sum()),
        z[agree],
        z[agree] - 1 / w[agree],
        np.log(there[clear] / here[clear]).astype(np.float64),
    )


def sample_inverse_depth(inverse: Float32Array, pixels: Float64Array) -> Float64Array:
    """Inverse depth at pixel coordinates (N x 2, at least half a pixel inside), bilinear; 0 across depth edges."""
    left, top = np.floor(pixels - 0.5).astype(np.intp).T
    right, bottom = np.minimum(left + 1, inverse.shape[1] - 1), np.minimum(top + 1, inverse.shape[0] - 1)
    corners = np.stack([inverse[top, left], inverse[top, right], inverse[bottom, left], inverse[bottom, right]])
    u, v = (pixels - 0.5 - np.stack([left, top], 1)).T
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v])
    one_surface = corners.min(0) > (1 - AGREES) * corners.max(0)
    return np.where(one_surface, (weights * corners).sum(0), 0.0)


def fit_noise(found: Sequence[Overlap]) -> tuple[float, float]:
    """a and b of the standard deviation hypot(a, b z^2) of one frame's depth z, from differences of two frames' depths."""
    depth = np.concatenate([each.depth for each in found])
    error = np.abs(np.concatenate([each.error for each in found]))
    if len(depth) < ENOUGH:
        return 0.0, 0.0
    order = np.argsort(depth)
    parts = np.array_split(order, min(8, max(1, len(order) // ENOUGH)))
    middle = np.array([np.median(depth[part]) for part in parts])
    variance = np.array([(1.4826 * np.median(error[part])) ** 2 / 2 for part in parts])  # of one of the two
    a, b = np.linalg.lstsq(np.stack([np.ones_like(middle), middle**4], 1), variance, rcond=None)[0]
    if a < 0:
        a, b = 0.0, float((variance * middle**4).sum() / (middle**8).sum())
    elif b < 0:
        a, b = float(variance.mean()), 0.0
    return float(np.sqrt(a)), float(np.sqrt(b))


def fit_gains(count: int, found: dict[tuple[int, int], Overlap]) -> Float64Array:
    """count x 3 gains of each frame's channels that make all equally bright; their geometric mean is 1.

    Least squares over the median ratio of each pair with enough common samples, by normal equations: their size is that of the
    frames for any number of pairs. 1 where there is none.
    """
    system = 1e-6 * np.eye(count)  # what no pair ties to the others stays as it is
    right = np.zeros((count, 3))
    for (i, j), each in found.items():
        if len(each.ratio) >= ENOUGH:
            weight, targets = len(each.ratio), np.median(each.ratio, axis=0)
            system[[i, j], [i, j]] += weight
            system[[i, j], [j, i]] -= weight
            right[i] += weight * targets
            right[j] -= weight * targets
    logs = np.linalg.solve(system, right)
    return np.exp(logs - logs.mean(0))
