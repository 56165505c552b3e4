"""Shadows of things: the certainty of a thrown shape fitted on procedural worlds, and what is found held against the truth.

    python benchmarks/shadows.py train [--worlds 120] [--seed 40000]       prints WEIGHTS of src/dlama/perception/shadows.py
    python benchmarks/shadows.py measure [worlds:16:3000 ../shared/street ...] [--every 2]

`train` throws each thing's shape by the light that explains most, calls it right where more than half of it lies in the true
shadow, and fits a logistic regression to the features; half of the worlds in turn are held out for the printed rates. `measure`
prints recall and precision of what is found with the true mask, by scene (of worlds together), frames without a shadow apart;
`oracle` is the shape thrown by the true light, in worlds, where that is known: what no better search could exceed.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from dlama.datasets.frames import RemovalTruth
from dlama.evaluation.metrics.masks import darkened
from dlama.evaluation.protocols.mask import SMALLEST_SHADOW_PX
from dlama.geometry.holes import dilated
from dlama.perception import shadows as room
from dlama.perception.masks.supports import planes_of
from dlama.perception.shadow_search import Scale
from dlama.worlds.dataset import open_dataset_or_worlds, world, worlds

RIDGE = 1.0
"""Squared weights, of features in standard deviations, count so much."""
NEWTON_STEPS = 30


def true_shadow(truth: RemovalTruth) -> np.ndarray:
    return darkened(truth.source.color, truth.without.color, truth.mask)


def rows_of(truths: Iterator[RemovalTruth], scale: Scale) -> tuple[np.ndarray, np.ndarray]:
    """N x features, and N: whether the thrown shape is right."""
    features, right = [], []
    for truth in truths:
        ground = room.ground_of(truth.source, truth.mask, planes_of(truth.source))
        if ground is None:
            continue
        usable = ground.surface & ~dilated(truth.mask, room.EDGE_PX)
        thrown = room.thrown_shape(truth.source, truth.mask, ground, usable, scale)
        if thrown is None:
            continue
        true = true_shadow(truth)
        features.append(thrown[1])
        right.append(true.sum() >= SMALLEST_SHADOW_PX and (true & thrown[0]).sum() > 0.5 * thrown[0].sum())
    return np.array(features), np.array(right, np.float64)


def fitted(features: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Weights of the features as they are, and the constant last: logistic regression by Newton's method."""
    middle, spread = features.mean(0), features.std(0)
    design = np.c_[(features - middle) / spread, np.ones(len(features))]
    ridge = RIDGE * np.r_[np.ones(features.shape[1]), 1e-6]
    weights = np.zeros(design.shape[1])
    for _ in range(NEWTON_STEPS):
        said = 1 / (1 + np.exp(-design @ weights))
        curve = (design * (said * (1 - said))[:, None]).T @ design + np.diag(ridge)
        weights -= np.linalg.solve(curve, design.T @ (said - right) + ridge * weights)
    plain = weights[:-1] / spread
    return np.r_[plain, weights[-1] - plain @ middle]


def train(count: int, seed: int) -> None:
    for scale in room.WEIGHTS:
        cases = (case for case in worlds(count, seed=seed).cases if case.protocol == "ori" and case.yaw == 0)
        report(scale, *rows_of((case.load() for case in cases), scale))


def report(scale: Scale, features: np.ndarray, right: np.ndarray) -> None:
    half = np.arange(len(right)) % 2 == 0
    said = np.zeros(len(right))
    for held in (half, ~half):
        weights = fitted(features[~held], right[~held])
        said[held] = 1 / (1 + np.exp(-(features[held] @ weights[:-1] + weights[-1])))
    print(f"scale {scale}: {len(right)} thrown shapes, {right.mean():.2f} right")
    for least in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8):
        taken = said >= least
        print(
            f"certain {least}: {right[taken].sum() / right.sum():.2f} of the right are taken, {right[taken].mean():.2f} right"
        )
    print(f"WEIGHTS = ({', '.join(f'{each:.3f}' for each in fitted(features, right))})")


def oracle(truth: RemovalTruth, seed: int) -> np.ndarray | None:
    """The shape thrown by the true light, grown as what is found is."""
    rgbd, mask = truth.source, truth.mask
    ground = room.ground_of(rgbd, mask, planes_of(rgbd))
    if ground is None:
        return None
    to_light = rgbd.camera.world_from_cam[:3, :3].T @ np.array(world(seed).light.to_light)
    up = -ground.normal / np.linalg.norm(ground.normal)
    points, rise = room.thing_points(rgbd, mask, ground)
    over = up - to_light / max(float(to_light @ up), 1e-3)
    usable = ground.surface & ~dilated(mask, room.EDGE_PX)
    shape = room.filled_shape(points - rise[:, None] * up + rise[:, None] * over, rgbd, usable)
    return room.in_picture(rgbd, mask, ground, usable, shape)


def rates(found: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    both = float((found & true).sum())
    return both / max(float(true.sum()), 1.0), both / found.sum() if found.any() else float("nan")


def measure(names: Sequence[str], every: int) -> None:
    print("| frames | with a shadow | found in | recall | precision | false alarms, % | oracle: recall | precision |")
    print("|---|---|---|---|---|---|---|---|")
    for name in names:
        groups: dict[str, list[tuple[float, ...]]] = defaultdict(list)
        alarms: dict[str, list[float]] = defaultdict(list)
        cases = [case for case in open_dataset_or_worlds(name).cases if case.protocol == "ori"]
        generated = name.startswith("worlds")
        for case in [case for case in cases if case.yaw == 0] if generated else cases[::every]:
            truth = case.load()
            assert isinstance(truth, RemovalTruth)
            true, found = true_shadow(truth), room.find_shadow(truth.source, truth.mask)
            group = name if generated else case.scene
            if true.sum() < SMALLEST_SHADOW_PX:
                alarms[group].append(100 * float(found.mean()))
                continue
            best = oracle(truth, int(case.scene[1:])) if generated else None
            groups[group].append((*rates(found, true), *(rates(best, true) if best is not None else (np.nan, np.nan))))
        for group in sorted({*groups, *alarms}):
            rows, false = np.array(groups[group]).reshape(-1, 4), alarms[group] or [0.0]
            means = [float(np.nanmean(column)) if np.isfinite(column).any() else float("nan") for column in rows.T]
            print(
                f"| {group} | {len(rows)} | {np.isfinite(rows[:, 1]).sum()} | {means[0]:.2f} | {means[1]:.2f} "
                f"| {np.mean(false):.2f} (worst {max(false):.2f}) of {len(alarms[group])} | {means[2]:.2f} | {means[3]:.2f} |",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("train", "measure"))
    parser.add_argument("names", nargs="*", default=["worlds:16:3000"], help="data sets of `measure`")
    parser.add_argument("--worlds", type=int, default=120)
    parser.add_argument("--seed", type=int, default=40_000)
    parser.add_argument("--every", type=int, default=1, help="only each such frame of a folder")
    given = parser.parse_args()
    if given.what == "train":
        train(given.worlds, given.seed)
    else:
        measure(given.names, given.every)


if __name__ == "__main__":
    main()
