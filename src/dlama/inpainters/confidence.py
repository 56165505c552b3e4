"""Confidence: a view with holes and a fill in; the probability that each filled pixel is right out.

Right means: its depth is within 5 % AND its colour within 25 levels (mean over the channels) of what a camera there would see.
The probability comes from a small network (five hundred weights) that sees distances, hole types, contrast and depth round each
pixel, but not the filler's name. It was trained on procedural worlds (src/dlama/assets/confidence/README.md) by

    python benchmarks/confidence.py train
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dlama.geometry.holes import nearest_known
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import HoleType, Origin, View
from dlama.models.perceptron import Perceptron, read_arrays

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
PIECE = 1 << 10
"""Pixels of one batch: so few that a matrix product takes one thread, since waiting threads took more time than the product."""
LARGEST_CONFIDENCE = 0.99
"""Largest probability of a filled pixel; 1 is what was measured."""
WEIGHTS = Path(__file__).parents[1] / "assets" / "confidence" / "confidence.npz"


class ConfidenceNetwork(Perceptron):
    """FEATURES in, OUTPUTS out."""

    def __call__(self, features: Float32Array) -> tuple[Float32Array, Float32Array]:
        """N x 2 probabilities of N x FEATURES (depth and colour right; depth right), at most LARGEST_CONFIDENCE; and N x 2
        expected errors, of depth in filled depths (0..1), of colour in levels."""
        out = np.clip(self.outputs(features, REACH), -30, 30)
        p = 1 / (1 + np.exp(-out[:, :2]))
        errors = np.minimum(np.exp(out[:, 2:]), (1, 255 / COLOR_WITHIN)) * (1, COLOR_WITHIN)
        return np.clip(p, 1 - LARGEST_CONFIDENCE, LARGEST_CONFIDENCE).astype(np.float32), errors.astype(np.float32)


@functools.cache
def confidence_network(path: Path = WEIGHTS) -> ConfidenceNetwork:
    """The network that ships. FileError where the file is damaged."""
    return ConfidenceNetwork.of(read_arrays(path), path, layers=3, inputs=FEATURES, outputs=OUTPUTS)


def judge_fill(view: View, color: UInt8Array, depth: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Confidence (H x W) and expected errors (H x W x 2) of a fill.

    Confidence is, in the view's hole, the probability that a filled pixel is right; where only depth was filled (the colour is
    measured), that the depth is; elsewhere the view's own. Errors are those of `View.errors`: of depth in metres, at most the
    depth itself, +inf where it is far; of colour in levels, 0 where it is measured; elsewhere the view's own, or 0.

    Args:
        view: with its holes.
        color: H x W x 3 uint8, filled.
        depth: H x W metres, filled; +inf = far.
    """
    confidence = view.confidence.copy()
    errors = np.zeros((*view.hole.shape, 2), np.float32) if view.errors is None else view.errors.copy()
    if view.hole.any():
        probabilities, expected = run_in_batches(confidence_network(), feature_rows(view, color, depth))
        both, depth_alone = probabilities.T
        painted = view.color_hole[view.hole]
        confidence[view.hole] = np.where(painted, both, np.maximum(both, depth_alone))
        errors[view.hole] = np.stack([expected[:, 0] * depth[view.hole], expected[:, 1] * painted], 1)
    return confidence, errors


def run_in_batches(network: ConfidenceNetwork, rows: Float32Array) -> tuple[Float32Array, Float32Array]:
    """The network's outputs for FEATURES x N `rows`, in batches that stay in the processor's cache."""
    probabilities, expected = np.empty((2, rows.shape[1], 2), np.float32)
    for start in range(0, rows.shape[1], PIECE):
        piece = slice(start, start + PIECE)
        probabilities[piece], expected[piece] = network(np.ascontiguousarray(rows[:, piece].T))
    return probabilities, expected


def feature_rows(view: View, color: UInt8Array, depth: Float32Array) -> Float32Array:
    """FEATURES x N of the N hole pixels, row by row, arguments as of `judge_fill`: one feature at a time, to save memory.

    No feature depends on the picture's size in pixels or on the scene's scale.
    """
    rows = np.empty((FEATURES, np.count_nonzero(view.hole)), np.float32)
    for row, feature in zip(rows, each_feature(view, color, depth), strict=True):
        row[:] = feature
    return rows


def each_feature(view: View, color: UInt8Array, depth: Float32Array) -> Iterator[np.ndarray | np.floating[Any]]:
    """Each of FEATURES: N values, or one for all."""
    hole = view.hole
    diagonal = float(np.hypot(*hole.shape))
    distance, nearest = nearest_known(~hole)
    rim, distance = nearest[hole], distance[hole]
    del nearest
    yield np.log1p(distance / (0.01 * diagonal))
    yield distance / diagonal
    for kind in TYPES:
        yield view.hole_type[hole] == kind
    known_w = inverse_depth(np.where(hole, np.float32(0), view.depth))
    w = inverse_depth(np.where(hole, depth, view.depth))
    typical = float(np.median(known_w[known_w > 0])) if (known_w > 0).any() else 1.0
    log_w = np.log(np.maximum(w, np.float32(0.02 * typical)) / typical)
    here, there = log_w[hole], log_w.ravel()[rim]
    yield here
    yield there
    yield np.abs(here - there)
    yield w[hole] == 0
    yield known_w.ravel()[rim] == 0
    del w, known_w, here
    known_grey, grey = channel_mean(view.color), channel_mean(color)
    mean, contrast = (of.ravel()[rim] for of in local_contrast(known_grey, ~hole, BROAD * diagonal))
    yield np.log1p(contrast)
    yield np.log1p(local_contrast(known_grey, ~hole, FINE * diagonal)[1].ravel()[rim])
    level, relief = (of.ravel()[rim] for of in local_contrast(log_w, view.valid, BROAD * diagonal))
    yield np.log1p(10 * relief)
    yield np.log1p((np.hypot(*(cv2.Scharr(log_w, cv2.CV_32F, *way) for way in ((1, 0), (0, 1)))) * diagonal / 32)[hole])
    painted, nearest_grey = grey[hole], known_grey.ravel()[rim]
    yield np.log1p(np.abs(painted - mean))
    yield np.float32(np.log(hole.mean()))
    yield painted / 255
    yield local_contrast(grey, np.ones_like(hole), FINE * diagonal)[1][hole] / 25
    yield np.log1p(np.abs(painted - nearest_grey))
    yield np.log1p(np.abs(nearest_grey - mean))
    yield np.abs(there - level)
    yield blur((~hole).astype(np.float32), BROAD * diagonal)[hole]
    yield np.log1p(100 * local_contrast(log_w, view.valid, FINE * diagonal)[1].ravel()[rim])
    yield np.float32(estimate_noise(known_grey, ~hole))
    yield np.float32(estimate_noise(log_w, view.valid, 1000))
    yield np.float32((view.hole_type == HoleType.SENSOR).mean())
    yield np.float32((view.origin == Origin.ESTIMATED).any())


def estimate_noise(values: Float32Array, known: BoolArray, scale: float = 1) -> float:
    """Median step between neighbours of known pixels and the mean of theirs (four), as log(1 + scale * step)."""
    inside = cv2.erode(known.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    steps = np.abs(cv2.Laplacian(values, cv2.CV_32F))[inside][::4] / 4
    return float(np.log1p(scale * np.median(steps))) if steps.size else 0.0


def channel_mean(color: UInt8Array) -> Float32Array:
    """H x W float32 mean of H x W x 3 uint8."""
    return np.asarray(cv2.transform(color.astype(np.float32), np.full((1, 3), 1 / 3, np.float32)), np.float32)


def blur(values: Float32Array, sigma: float) -> Float32Array:
    """H x W under a Gaussian of `sigma` pixels; computed at a coarser size where it is broad."""
    by = max(1, int(sigma // 2))
    size = max(1, values.shape[1] // by), max(1, values.shape[0] // by)
    coarse = cv2.GaussianBlur(cv2.resize(values, size, interpolation=cv2.INTER_AREA), (0, 0), max(sigma / by, 0.5))
    return np.asarray(cv2.resize(coarse, (values.shape[1], values.shape[0])), np.float32)


def local_contrast(values: Float32Array, known: BoolArray, sigma: float) -> tuple[Float32Array, Float32Array]:
    """(mean, standard deviation), H x W, of the known values round each pixel under a Gaussian of `sigma` pixels."""
    by = max(1, int(sigma // 2))  # the blur is computed at a coarser size where it is broad
    size = max(1, values.shape[1] // by), max(1, values.shape[0] // by)
    weight = known.astype(np.float32)
    sums = [
        cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in (weight, values * weight, values**2 * weight)
    ]
    share, first, second = (cv2.GaussianBlur(part, (0, 0), max(sigma / by, 0.5)) for part in sums)
    mean = first / np.maximum(share, 1e-6)
    deviation = np.sqrt(np.maximum(second / np.maximum(share, 1e-6) - mean**2, 0))
    full = values.shape[1], values.shape[0]
    return np.asarray(cv2.resize(mean, full), np.float32), np.asarray(cv2.resize(deviation, full), np.float32)
