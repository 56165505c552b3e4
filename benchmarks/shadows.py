"""Shadows of things: the certainty of a thrown shape fitted on procedural worlds, and what is found held against the truth.

    python benchmarks/shadows.py train [--worlds 120] [--seed 40000]   prints WEIGHTS of src/dlama/perception/shadows/cast.py
    python benchmarks/shadows.py measure [worlds:16:3000 ../shared/street ...] [--every 2] [--removal]

`train` throws each thing's shape by the light that explains most, calls it right where more than half of it lies in the true
shadow, and fits a logistic regression to the features; half of the worlds in turn are held out for the printed rates. `measure`
prints recall and precision of what is found with the true mask, by scene (of worlds together), frames without a shadow apart,
the contact line within 2 px of the thing left out;
with `--removal` also the squared error of colour in the true shadow after the thing is removed with and without what is found.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from dlama.completion.verbs import remove
from dlama.datasets.frames import RemovalTruth
from dlama.evaluation.metrics.masks import SMALLEST_SHADOW_PX, darkened_by_shadow, outside_contact_band
from dlama.geometry.holes import dilate_mask
from dlama.perception.masks.supports import find_planes_of_picture
from dlama.perception.shadows.cast import find_cast_shape
from dlama.perception.shadows.find import find_shadow
from dlama.perception.shadows.ground import EDGE_PX, find_ground, measure_object, object_points
from dlama.worlds.dataset import open_dataset_or_worlds, worlds
from logistic import logistic_weights

RIDGE = 1.0
"""Squared weights, of features in standard deviations, count so much."""


def true_shadow(truth: RemovalTruth) -> np.ndarray:
    return darkened_by_shadow(truth.source.color, truth.without.color, truth.mask)


def rows_of(truths: Iterator[RemovalTruth]) -> tuple[np.ndarray, np.ndarray]:
    """N x features, and N: whether the thrown shape is right."""
    features, right = [], []
    for truth in truths:
        ground = find_ground(truth.source, truth.mask, find_planes_of_picture(truth.source))
        if ground is None:
            continue
        usable = ground.surface & ~dilate_mask(truth.mask, EDGE_PX)
        thing = measure_object(*object_points(truth.source, truth.mask, ground), ground)
        thrown = find_cast_shape(truth.source, usable, thing)
        if thrown is None:
            continue
        true, (shape, of_shape) = true_shadow(truth), thrown
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
    said = np.zeros(len(right))
    for held in (half, ~half):
        weights = fitted(features[~held], right[~held])
        said[held] = 1 / (1 + np.exp(-(features[held] @ weights[:-1] + weights[-1])))
    print(f"{len(right)} thrown shapes, {right.mean():.2f} right")
    for least in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8):
        taken = said >= least
        print(
            f"certain {least}: {right[taken].sum() / right.sum():.2f} of the right are taken, {right[taken].mean():.2f} right"
        )
    print(f"WEIGHTS = ({', '.join(f'{each:.3f}' for each in fitted(features, right))})")


def rates(found: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    both = float((found & true).sum())
    return both / max(float(true.sum()), 1.0), both / found.sum() if found.any() else float("nan")


def errors(truth: RemovalTruth, true: np.ndarray, found: np.ndarray) -> tuple[float, float]:
    """Mean squared error of colour in the true shadow, removed with the thing's mask alone and with the shadow that is found."""
    out = []
    for mask in (truth.mask, truth.mask | found):
        off = remove(truth.source, mask).view.color[true].astype(np.float64) - truth.without.color[true]
        out.append(float((off**2).mean()))
        if not found.any():
            return out[0], out[0]
    return out[0], out[1]


def measure(names: Sequence[str], every: int, removal: bool) -> None:
    print("| frames | with a shadow | found in | recall | precision | false alarms, % | MSE without, with |")
    print("|---|---|---|---|---|---|---|")
    for name in names:
        groups: dict[str, list[tuple[float, ...]]] = defaultdict(list)
        alarms: dict[str, list[float]] = defaultdict(list)
        cases = [case for case in open_dataset_or_worlds(name).cases if case.protocol == "ori"]
        generated = name.startswith("worlds")
        for case in [case for case in cases if case.yaw == 0] if generated else cases[::every]:
            truth = case.load()
            assert isinstance(truth, RemovalTruth)
            true, found = true_shadow(truth), find_shadow(truth.source, truth.mask)
            compared = found & outside_contact_band(truth.mask)
            group = name if generated else case.scene
            if true.sum() < SMALLEST_SHADOW_PX:
                alarms[group].append(100 * float(compared.mean()))
                continue
            groups[group].append(
                (*rates(compared, true), *(errors(truth, true, found) if removal else (np.nan, np.nan)))
            )
        for group in sorted({*groups, *alarms}):
            rows, false = np.array(groups[group]).reshape(-1, 4), alarms[group] or [0.0]
            means = [float(np.nanmean(column)) if np.isfinite(column).any() else float("nan") for column in rows.T]
            print(
                f"| {group} | {len(rows)} | {np.isfinite(rows[:, 1]).sum()} | {means[0]:.2f} | {means[1]:.2f} "
                f"| {np.mean(false):.2f} (worst {max(false):.2f}) of {len(alarms[group])} | {means[2]:.0f}, {means[3]:.0f} |",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("train", "measure"))
    parser.add_argument("names", nargs="*", default=["worlds:16:3000"], help="data sets of `measure`")
    parser.add_argument("--worlds", type=int, default=120)
    parser.add_argument("--seed", type=int, default=40_000)
    parser.add_argument("--every", type=int, default=1, help="only each such frame of a folder")
    parser.add_argument("--removal", action="store_true", help="also remove the thing, with and without its shadow")
    given = parser.parse_args()
    if given.what == "train":
        train(given.worlds, given.seed)
    else:
        measure(given.names, given.every, given.removal)


if __name__ == "__main__":
    main()
