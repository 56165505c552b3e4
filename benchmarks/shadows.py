"""The probability of an object's cast shape, fitted on procedural worlds.

    python benchmarks/shadows.py [--worlds 120] [--seed 40000]   prints WEIGHTS of src/dlama/perception/shadows/cast.py

Each object's shape is cast by the light that explains most; it is right where more than half of it lies in the true shadow. A
logistic regression is fitted to its features; half of the worlds in turn are held out for the printed rates. What is found in the
end is measured by shadow_rules.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from dlama.datasets.frames import RemovalTruth
from dlama.evaluation.metrics.masks import SMALLEST_SHADOW_PX, darkened_by_shadow
from dlama.geometry.holes import dilate_mask
from dlama.perception.masks.supports import find_planes_of_picture
from dlama.perception.shadows.cast import find_cast_shape
from dlama.perception.shadows.ground import EDGE_PX, find_ground, measure_object, object_points
from dlama.worlds.dataset import worlds
from shadow_classifier import logistic_weights

RIDGE = 1.0
"""Squared weights, of features in standard deviations, count so much."""


def true_shadow(truth: RemovalTruth) -> np.ndarray:
    return darkened_by_shadow(truth.source.color, truth.without.color, truth.mask)


def rows_of(truths: Iterator[RemovalTruth]) -> tuple[np.ndarray, np.ndarray]:
    """N x features, and N: whether the cast shape is right."""
    features, right = [], []
    for truth in truths:
        ground = find_ground(truth.source, truth.mask, find_planes_of_picture(truth.source))
        if ground is None:
            continue
        usable = ground.surface & ~dilate_mask(truth.mask, EDGE_PX)
        caster = measure_object(*object_points(truth.source, truth.mask, ground), ground)
        cast = find_cast_shape(truth.source, usable, caster)
        if cast is None:
            continue
        true, (shape, of_shape) = true_shadow(truth), cast
        features.append(of_shape)
        right.append(true.sum() >= SMALLEST_SHADOW_PX and (true & shape).sum() > 0.5 * shape.sum())
    return np.array(features), np.array(right, np.float64)


def fitted(features: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Weights of the features as they are, and the constant last: logistic regression."""
    middle, spread = features.mean(0), features.std(0)
    weights = logistic_weights((features - middle) / spread, right, RIDGE)
    plain = weights[:-1] / spread
    return np.r_[plain, weights[-1] - plain @ middle]


def train(count: int, seed: int) -> None:
    cases = (case for case in worlds(count, seed=seed).cases if case.protocol == "ori" and case.yaw == 0)
    report(*rows_of(case.load() for case in cases))


def report(features: np.ndarray, right: np.ndarray) -> None:
    half = np.arange(len(right)) % 2 == 0
    predicted = np.zeros(len(right))
    for held in (half, ~half):
        weights = fitted(features[~held], right[~held])
        predicted[held] = 1 / (1 + np.exp(-(features[held] @ weights[:-1] + weights[-1])))
    print(f"{len(right)} cast shapes, {right.mean():.2f} right")
    for least in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8):
        taken = predicted >= least
        print(
            f"certain {least}: {right[taken].sum() / right.sum():.2f} of the right are taken, {right[taken].mean():.2f} right"
        )
    print(f"WEIGHTS = ({', '.join(f'{each:.3f}' for each in fitted(features, right))})")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=120)
    parser.add_argument("--seed", type=int, default=40_000)
    given = parser.parse_args()
    train(given.worlds, given.seed)


if __name__ == "__main__":
    main()
