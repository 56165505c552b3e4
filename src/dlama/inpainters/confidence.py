"""Confidence: a view with holes and a fill in; the probability that each filled pixel is right out.

Right means: its depth is within 5 % AND its colour within 25 levels (mean over the channels) of what a camera there would see.
The probability comes from a small network (five hundred weights) that sees distances, hole types, contrast and depth round each
pixel, but not the filler's name. It was trained on procedural worlds (src/dlama/assets/confidence/README.md) by

    python benchmarks/confidence.py train
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import LARGEST_CONFIDENCE, HoleType, Origin
from dlama.geometry.holes import erode_square, fill_with_nearest, nearest_known
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, sampled_pixels
from dlama.geometry.view import View
from dlama.models.network_file import ASSETS
from dlama.models.perceptron import Perceptron
from dlama.perception.resampling import interpolate

DEPTH_WITHIN = 0.05
"""Largest relative error of a right depth."""
COLOR_WITHIN = 25.0
"""Largest error of a right colour, levels of 8 bit, mean over the channels."""
FINE, BROAD = 0.005, 0.02
"""Sigma, as a share of the diagonal, of the surroundings in which contrast is measured."""
TYPES = (HoleType.DISOCCLUDED, HoleType.OUT_OF_VIEW, HoleType.SENSOR, HoleType.OBJECT)
"""Hole types that the network distinguishes; the rest are cracks and flying pixels."""
FEATURES, OUTPUTS = 28, 4
REACH = 3.0
"""Features are clipped at so many standard deviations of the training data."""
WEIGHTS = ASSETS / "confidence" / "confidence.npz"


class ConfidenceNetwork(Perceptron):
    """FEATURES in, OUTPUTS out."""

    def __call__(self, features: Float32Array) -> tuple[Float32Array, Float32Array]:
        """N x 2 probabilities of N x FEATURES (depth and colour right; depth right), at most LARGEST_CONFIDENCE; and N x 2
        expected errors, of depth in filled depths (0..1), of colour in levels."""
        out = np.clip(self.outputs(features, REACH), -30, 30)
        p = 1 / (1 + np.exp(-out[:, :2]))
        most, unit = np.array([(1, 255 / COLOR_WITHIN), (1, COLOR_WITHIN)], np.float32)
        errors = np.minimum(np.exp(out[:, 2:]), most) * unit
        return np.clip(p, 1 - LARGEST_CONFIDENCE, LARGEST_CONFIDENCE), errors


@functools.cache
def confidence_network(path: Path = WEIGHTS) -> ConfidenceNetwork:
    """The network that ships. FileError where the file is damaged."""
    return ConfidenceNetwork.of(path)


def judge_fill(
    view: View, color: UInt8Array, depth: Float32Array, known: KnownFeatures | None = None
) -> tuple[Float32Array, Float32Array]:
    """Confidence (H x W) and expected errors (H x W x 2) of a fill.

    Confidence is, in the view's hole, the probability that a filled pixel is right; where only depth was filled (the colour is
    measured), that the depth is; elsewhere the view's own. Errors are those of `View.errors`: of depth in metres, at most the
    depth itself, +inf where it is far; of colour in levels, 0 where it is measured; elsewhere the view's own, or 0.

    Args:
        view: with its holes.
        color: H x W x 3 uint8, filled.
        depth: H x W metres, filled; +inf = far.
        known: `features_of_known` of the view, where they were found already.
    """
    confidence = view.confidence.copy()
    errors = np.zeros((*view.hole.shape, 2), np.float32) if view.errors is None else view.errors.copy()
    if view.hole.any():
        known = known or features_of_known(view)
        found = np.hstack(confidence_network()(feature_rows(known, color, depth).T))
        both, depth_alone, *expected = enlarge_to_hole(found, known, view.hole)
        painted = view.color_hole[view.hole]
        confidence[view.hole] = np.where(painted, both, np.maximum(both, depth_alone))
        errors[view.hole] = np.stack([expected[0] * depth[view.hole], expected[1] * painted], 1)
    return confidence, errors


def enlarge_to_hole(found: Float32Array, known: KnownFeatures, hole: BoolArray) -> list[Float32Array]:
    """Each of N' x C values of the hole pixels that were judged, interpolated to the N pixels of the view's hole (H x W)."""
    judged, step = known.view.hole, known.step
    if step == 1:
        return list(found.T)
    small = np.zeros((*judged.shape, found.shape[1]), np.float32)
    small[judged] = found
    small = fill_with_nearest(small, judged)
    wh, (height, width) = (step * judged.shape[1], step * judged.shape[0]), hole.shape
    planes = (np.ascontiguousarray(small[..., k]) for k in range(small.shape[2]))
    return [np.asarray(cv2.resize(one, wh)[:height, :width][hole], np.float32) for one in planes]


class KnownFeatures(NamedTuple):
    """What is known round each of the N hole pixels of a view that are judged, the same for every fill."""

    view: View
    """Every `step`-th pixel of it."""
    step: int
    rows: Float32Array
    """FEATURES x N; those that `feature_rows` fills in are open."""
    rim: NDArray[np.intp]
    """N, flat index of the nearest known pixel."""
    typical: float
    """Median inverse depth, 1/m."""
    mean: Float32Array
    """N, mean grey level round the rim."""


def features_of_known(view: View, noise: float = 0.0) -> KnownFeatures:
    """The features of a view that its known pixels give.

    No feature depends on the picture's size in pixels or on the scene's scale. Of a large view some pixels are judged.
    noise: of the depth as it was measured (`depth_noise`), for the view may be drawn without it.
    """
    step = judged_step(view)
    if not view.hole[sampled_pixels(view.hole.shape, step)].any():
        step = 1
    view = view.subsample(step)
    hole = view.hole
    rows = np.empty((FEATURES, np.count_nonzero(hole)), np.float32)
    diagonal = float(np.hypot(*hole.shape))
    distance, nearest = nearest_known(~hole)
    rim, distance = nearest[hole], distance[hole]
    rows[0] = np.log1p(distance / (0.01 * diagonal))
    rows[1] = distance / diagonal
    kinds = view.hole_type[hole]
    for row, kind in enumerate(TYPES, start=2):
        rows[row] = kinds == int(kind)
    w, typical = known_inverse_depth(view)
    rows[10] = w.ravel()[rim] == 0
    log_w = log_inverse(w, typical)
    there = rows[7] = log_w.ravel()[rim]
    level, relief = (of.ravel()[rim] for of in local_contrast(log_w, view.valid, BROAD * diagonal))
    rows[13] = np.log1p(10 * relief)
    rows[21] = np.abs(there - level)
    rows[23] = np.log1p(100 * local_contrast(log_w, view.valid, FINE * diagonal)[1].ravel()[rim])
    rows[25] = max(noise, estimate_noise(log_w, view.valid, 1000))
    grey = channel_mean(view.color)
    mean, contrast = (of.ravel()[rim] for of in local_contrast(grey, ~hole, BROAD * diagonal))
    rows[11] = np.log1p(contrast)
    rows[12] = np.log1p(local_contrast(grey, ~hole, FINE * diagonal)[1].ravel()[rim])
    rows[20] = np.log1p(np.abs(grey.ravel()[rim] - mean))
    rows[24] = estimate_noise(grey, ~hole)
    rows[22] = interpolate(blur_coarsely((~hole).astype(np.float32), BROAD * diagonal), hole.shape)[hole]
    rows[16] = np.log(hole.mean())
    rows[26] = (view.hole_type == HoleType.SENSOR.value).mean()
    rows[27] = (view.origin == Origin.ESTIMATED.value).any()
    return KnownFeatures(view, step, rows, rim, typical, mean)


def feature_rows(known: KnownFeatures, color: UInt8Array, depth: Float32Array) -> Float32Array:
    """FEATURES x N of the N hole pixels that are judged, row by row, arguments as of `judge_fill`."""
    view, step, rows, rim, typical, mean = known
    if step > 1:
        at = sampled_pixels(depth.shape, step)
        color, depth = color[at], depth[at]
    hole, diagonal = view.hole, float(np.hypot(*view.hole.shape))
    w = inverse_depth(np.where(hole, depth, view.depth))
    rows[9] = w[hole] == 0
    log_w = log_inverse(w, typical)
    rows[6] = log_w[hole]
    rows[8] = np.abs(rows[6] - rows[7])
    slope = np.hypot(*(cv2.Scharr(log_w, cv2.CV_32F, *way) for way in ((1, 0), (0, 1))))
    rows[14] = np.log1p(slope[hole] * diagonal / 32)
    grey = channel_mean(color)
    painted = grey[hole]
    rows[15] = np.log1p(np.abs(painted - mean))
    rows[17] = painted / 255
    rows[18] = local_contrast(grey, np.ones_like(hole), FINE * diagonal)[1][hole] / 25
    rows[19] = np.log1p(np.abs(painted - channel_mean(view.color.reshape(-1, 1, 3)[rim])[:, 0]))
    return rows


def depth_noise(view: View) -> float:
    """The feature that says how noisy a view's depth is, by itself."""
    view = view.subsample(judged_step(view))
    return estimate_noise(log_inverse(*known_inverse_depth(view)), view.valid, 1000)


def judged_step(view: View) -> int:
    """Every so many pixels of a view are judged: 320 along the longer side at most."""
    return -(-max(view.hole.shape) // 320)


def known_inverse_depth(view: View) -> tuple[Float32Array, float]:
    """H x W inverse depth (1/m) of a view, 0 in holes, and its median where it is not 0."""
    w = inverse_depth(np.where(view.hole, np.float32(0), view.depth))
    return w, float(np.median(w[w > 0])) if (w > 0).any() else 1.0


def log_inverse(w: Float32Array, typical: float) -> Float32Array:
    """Logarithm of inverse depth (H x W, 1/m) over a `typical` one, at least .02 of it."""
    return np.asarray(np.log(np.maximum(w, np.float32(0.02 * typical)) / typical), np.float32)


def estimate_noise(values: Float32Array, known: BoolArray, scale: float = 1) -> float:
    """Median step between neighbours of known pixels and the mean of theirs (four), as log(1 + scale * step)."""
    inside = erode_square(known, 3)
    steps = np.abs(cv2.Laplacian(values, cv2.CV_32F))[inside][::4] / 4
    return float(np.log1p(scale * np.median(steps))) if steps.size else 0.0


def channel_mean(color: UInt8Array) -> Float32Array:
    """H x W float32 mean of H x W x 3 uint8."""
    return np.asarray(cv2.transform(color.astype(np.float32), np.full((1, 3), 1 / 3, np.float32)), np.float32)


def blur_coarsely(values: Float32Array, sigma: float) -> Float32Array:
    """H x W under a Gaussian of `sigma` pixels; in a smaller size where it is broad."""
    by = max(1, int(sigma // 2))
    if by > 1:
        size = max(1, values.shape[1] // by), max(1, values.shape[0] // by)
        values = np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA), np.float32)
    return np.asarray(cv2.GaussianBlur(values, (0, 0), max(sigma / by, 0.5)), np.float32)


def local_contrast(values: Float32Array, known: BoolArray, sigma: float) -> tuple[Float32Array, Float32Array]:
    """(mean, standard deviation), H x W, of the known values round each pixel under a Gaussian of `sigma` pixels."""
    weight = known.astype(np.float32)
    share, first, second = (blur_coarsely(part, sigma) for part in (weight, values * weight, values**2 * weight))
    share = np.maximum(share, 1e-6)
    mean = np.asarray(first / share, np.float32)
    deviation = np.asarray(np.sqrt(np.maximum(second / share - mean**2, 0)), np.float32)
    return interpolate(mean, values.shape), interpolate(deviation, values.shape)
