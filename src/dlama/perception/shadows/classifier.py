"""Planes of a crop round an object in; the probability of shadow of each pixel out, or None where no shadow is likely.

Four parts ship (`assets/shadow`): the network that marks pixels (`network`) and three small classifiers, made by
`benchmarks/shadow_classifier.py`. They decide which cast shape is right, which pixels belong to it, and whether the result is a
shadow at all.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama.geometry.holes import dilate_mask, erode_square, iou, regions_touching
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.models.network_file import ASSETS, NetworkFile
from dlama.models.perceptron import Perceptron
from dlama.perception.shadows.features import (
    FEWEST_PX,
    candidate_features,
    cast_interiors,
    pixel_features,
    surroundings,
    tone_steps,
)
from dlama.perception.shadows.planes import ShadowPlanes, network_probability
from dlama.perception.shadows.search import SMALLEST_PX

MODEL = ASSETS / "shadow" / "shadow.npz"
CLIP = 5.0
"""Standard deviations that features are clipped to."""
SHADOW = 0.5
"""Least probability of a pixel."""


class Classifier(Perceptron):
    """Features in, a probability out."""

    def __call__(self, features: Float32Array) -> Float32Array:
        """N probabilities of N x F features."""
        return np.asarray(1 / (1 + np.exp(-self.outputs(features, CLIP)[:, 0])), np.float32)


PARTS = ("candidate", "pixel", "verdict")
"""The classifiers."""


@functools.cache
def classifiers(path: Path = MODEL) -> dict[str, Classifier]:
    """PARTS of the file, read once a process. FileError where it is damaged."""
    return {part: Classifier.of(path, f"{part}.") for part in PARTS}


@dataclass(frozen=True, eq=False)
class LikelyShadows:
    """A candidate shadow, from a cast shape or from the network."""

    shape: BoolArray
    """h x w, the cast shape or the marked region."""
    probability: Float32Array
    """h x w probability of each pixel of the surface: by the network, or with a cast shape the mean of network and perceptron."""
    features: Float32Array
    """Features of the verdict: `verdict_features`, `agreement`, whether the network marks it, and `tone_steps`."""


def find_likely_shadows(
    planes: ShadowPlanes, parts: dict[str, Classifier], file: NetworkFile | None = None
) -> list[LikelyShadows]:
    """The candidates from the likeliest cast shape, extended to where its shadow ends, and from the network (`file`, or the one
    that ships)."""
    marked = network_probability(planes, file)
    region = marked > SHADOW
    shapes = cast_interiors(planes)
    every = candidate_features(planes, [*shapes, region])
    features, own = every[:-1], every[-1]
    there = np.isfinite(features).all(1)
    certainty = np.where(there, parts["candidate"](np.nan_to_num(features)), 0)
    out = []
    number = int(certainty.argmax())
    if certainty[number] >= 0.04:
        rows, where = pixel_features(planes, shapes[number], float(certainty[number]))
        marked_by_pixel = np.zeros(where.shape, np.float32)
        marked_by_pixel[where] = parts["pixel"](rows)
        last = verdict_features(
            planes, shapes[number], marked_by_pixel, float(certainty[number]), features[number], certainty
        )
        mean = np.asarray((marked_by_pixel + marked) / 2, np.float32)
        tones = tone_steps(planes, regions_touching(mean > SHADOW, shapes[number]))
        last = np.r_[last, agreement(marked, marked_by_pixel > SHADOW, planes.surface), 0, tones]
        out.append(LikelyShadows(shapes[number], mean, last))
    if region.sum() >= SMALLEST_PX:
        certain = float(parts["candidate"](own[None])[0])
        last = verdict_features(planes, region, marked, certain, own, certainty)
        tones = tone_steps(planes, region)
        out.append(LikelyShadows(region, marked, np.r_[last, agreement(marked, region, planes.surface), 1, tones]))
    return out


def agreement(marked: Float32Array, region: BoolArray, where: BoolArray) -> Float32Array:
    """Agreement of the network's probabilities (h x w) with a region: means inside, round it and where high; intersection over
    union; and the share marked in all."""
    ring = dilate_mask(region, 6) & ~dilate_mask(region, 1) & where
    high = marked > SHADOW
    means = [float(marked[each].mean()) if each.any() else 0.0 for each in (region, ring, high)]
    return np.array([*means, iou(high, region), np.log1p(float(high.sum()))], np.float32)


def verdict_features(
    planes: ShadowPlanes,
    shape: BoolArray,
    marked_by_pixel: Float32Array,
    certainty: float,
    features: Float32Array,
    all_probabilities: np.ndarray,
) -> Float32Array:
    """Features of a region: probabilities inside and outside, the step at its border, and the features of its shape."""
    where, dark = planes.surface, planes.plane("darkness")
    region = regions_touching(marked_by_pixel > SHADOW, shape)
    ring, rest = surroundings(region, where, 8)
    inner = region & erode_square(region, 3)
    inner = inner if inner.sum() >= FEWEST_PX else region
    deep = around = step = likely = likely_around = apart = 0.0
    if region.sum() >= FEWEST_PX <= ring.sum():
        deep, around = float(np.median(dark[inner])), float(np.median(dark[ring]))
        step = min((deep - around) / max(float(dark[ring].std()), 0.05), 4.0)
        likely, likely_around = float(marked_by_pixel[region].mean()), float(marked_by_pixel[ring].mean())
        middle = (deep + around) / 2
        apart = float((dark[inner] > middle).mean() + (dark[ring] < middle).mean()) - 1
    has_rest = rest.sum() > 50  # px
    own = [
        float(np.log(certainty + 1e-3) - np.log(1 - certainty + 1e-3)),
        float(np.sort(all_probabilities)[-2]) if len(all_probabilities) > 1 else 0.0,
        float(marked_by_pixel[shape].mean()) if shape.any() else 0.0,
        likely,
        likely_around,
        float(np.log1p(region.sum()) - np.log1p(shape.sum())),
        float((marked_by_pixel[rest] > SHADOW).mean()) if has_rest else 0.0,
        deep - around,
        step,
        apart,
        float((dark[rest] > (deep + around) / 2).mean()) if has_rest else 0.5,
        float(region[shape].mean()) if shape.any() else 0.0,
    ]
    return np.array([*own, *features], np.float32)


def shadow_probability(planes: ShadowPlanes) -> Float32Array | None:
    """h x w probabilities of the likeliest shadow. None where none is likely."""
    parts = classifiers()
    found = find_likely_shadows(planes, parts)
    if not found:
        return None
    certainty = parts["verdict"](np.stack([one.features for one in found]))
    return found[int(certainty.argmax())].probability if certainty.max() >= 0.3 else None
