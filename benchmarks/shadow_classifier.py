"""The classifiers that find an object's shadow: crops of procedural worlds to fit them on, and the file that ships.

    python benchmarks/shadow_classifier.py crops FOLDER [--photos ../shared/photos] [--count 1200] [--paved 0] [--held-out 160]
    python benchmarks/shadow_network.py FOLDER [-o src/dlama/assets/shadow/shadow.onnx]
    python benchmarks/shadow_classifier.py train FOLDER [-o src/dlama/assets/shadow/shadow.npz]

A thrown shape is right where more than half of it lies in the true shadow. Pixels are learnt on right shapes alone, and on parts
of the true shadow moved by a few pixels. What a shape leads to, or the network marks, is right where its F-score is GOOD or more;
the verdict is fitted on each fifth crop, which neither the network nor the other classifiers have seen. `train` prints rates on
the held-out crops.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import nn
from torch.nn.functional import binary_cross_entropy_with_logits

from dlama.geometry.holes import regions_touching
from dlama.models.network_file import NetworkFile
from dlama.perception.shadows.classifier import CLIP, PARTS, SHADOW, Classifier, LikelyShadows, find_likely_shadows
from dlama.perception.shadows.features import candidate_features, cast_interiors, pixel_features
from dlama.perception.shadows.planes import NETWORK, ShadowPlanes
from learning import learn
from shadow_crops import Crop, ShadowCrops, write_shadow_crops

TRAIN_SEED, PAVED_SEED, HELD_OUT_SEED = 50_000, 55_000, 90_000
FEWEST_PX, GOOD = 25, 0.5
"""Pixels of a crop's shadow that count as one; the F-score of a right answer."""
PIXELS, BATCH, STEPS, RATE, NOISE, DECAY = 800, 4096, 900, 4e-3, 0.08, 2e-2
HIDDEN = 32, 16
RIDGE = 3.0


def logistic_weights(features: np.ndarray, right: np.ndarray, ridge: float) -> np.ndarray:
    """F + 1 weights, the constant last, that make log odds of features: the least sum of log losses and ridge / 2 times squared
    weights (not the constant's); by Newton's method.

    features: N x F, each of about unit spread. right: N, 0 or 1.
    """
    design = np.c_[features, np.ones(len(features))]
    costs = ridge * np.r_[np.ones(features.shape[1]), 1e-6]
    weights = np.zeros(design.shape[1])
    for _ in range(30):
        predicted = 1 / (1 + np.exp(-design @ weights))
        curve = (design * (predicted * (1 - predicted))[:, None]).T @ design + np.diag(costs)
        weights -= np.linalg.solve(curve, design.T @ (predicted - right) + costs * weights)
    return weights


def logistic(features: np.ndarray, right: np.ndarray) -> Classifier:
    """Logistic regression, features in standard deviations."""
    middle, spread = features.mean(0), features.std(0) + 1e-3
    weights = logistic_weights(np.clip((features - middle) / spread, -CLIP, CLIP), right, RIDGE)
    layer = weights[:-1, None].astype(np.float32), weights[-1:].astype(np.float32)
    return Classifier(middle.astype(np.float32), spread.astype(np.float32), (layer,))


def right_shapes(planes: ShadowPlanes, target: np.ndarray) -> np.ndarray:
    true = target > 0.5
    shapes = [shape & (target >= 0) for shape in cast_interiors(planes)]
    return np.array([true.sum() >= FEWEST_PX and (one & true).sum() > 0.5 * max(one.sum(), 1) for one in shapes])


def candidates_of(planes: ShadowPlanes) -> np.ndarray:
    return candidate_features(planes, cast_interiors(planes))


def fit_candidates(crops: Sequence[Crop]) -> Classifier:
    features = np.concatenate([candidates_of(planes) for planes, _ in crops])
    right = np.concatenate([right_shapes(*crop) for crop in crops])
    there = np.isfinite(features).all(1)
    return logistic(features[there], right[there].astype(np.float64))


def as_thrown(true: np.ndarray, where: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Part of a true shadow (h x w), moved by up to 3 px, as if it had been thrown."""
    thinner = int(rng.integers(0, 4))
    part = cv2.erode(true.astype(np.uint8), np.ones((max(thinner, 1),) * 2, np.uint8))
    part = np.roll(part, rng.integers(-3, 4, 2), (0, 1)) > 0
    rows, columns = np.nonzero(part)
    if len(rows) > 10 and rng.random() < 0.5:
        turn = rng.uniform(0, 2 * np.pi)
        along = columns * np.cos(turn) + rows * np.sin(turn)
        gone = along > np.quantile(along, rng.uniform(0.4, 1))
        part[rows[gone], columns[gone]] = False
    return part & where


def pixel_rows(features: np.ndarray, target: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Some pixels of a crop, what they are, and weights by which every crop counts about the same."""
    dark, lit = np.flatnonzero(target > 0.5), np.flatnonzero((target >= 0) & (target <= 0.5))
    taken = [rng.permutation(each)[:most] for each, most in ((dark, PIXELS), (lit, 3 * PIXELS // 2))]
    weight = [np.full(len(some), len(each) / max(len(some), 1)) for some, each in zip(taken, (dark, lit))]
    chosen = np.concatenate(taken)
    return features[chosen], np.clip(target[chosen], 0, 1), np.concatenate(weight) / max(len(dark), 250)


def fit_pixels(crops: Sequence[Crop], candidates: Classifier, seed: int) -> Classifier:
    rng = np.random.default_rng(seed)
    made = []
    for planes, target in crops:
        if (target > 0.5).sum() < FEWEST_PX:
            continue
        shapes, right = cast_interiors(planes), np.flatnonzero(right_shapes(planes, target))
        sure = candidates(np.nan_to_num(candidate_features(planes, shapes)))
        used = [(shapes[number], max(float(sure[number]), 0.4)) for number in right]
        used.append((as_thrown(target > 0.5, planes.surface, rng), float(rng.uniform(0.4, 1))))
        for shape, certain in used:
            if shape.sum() > 10:
                features, where = pixel_features(planes, shape, certain)
                rows, true, weight = pixel_rows(features, target[where], rng)
                made.append((rows, true, weight / len(used)))
    return perceptron(*(np.concatenate(part).astype(np.float32) for part in zip(*made)), seed)


def perceptron(features: np.ndarray, true: np.ndarray, weight: np.ndarray, seed: int) -> Classifier:
    """By AdamW with noise on the features, which keeps it from learning few crops by heart."""
    torch.manual_seed(seed)
    mean, spread = features.mean(0), features.std(0) + np.float32(1e-3)
    x = torch.from_numpy(np.clip((features - mean) / spread, -CLIP, CLIP))
    y, w = torch.from_numpy(true), torch.from_numpy(weight / weight.mean())
    sizes = features.shape[1], *HIDDEN, 1
    linear = [nn.Linear(a, b) for a, b in itertools.pairwise(sizes)]
    nn.init.constant_(linear[-1].bias, -1.0)
    network = nn.Sequential(linear[0], nn.ReLU(), linear[1], nn.ReLU(), linear[2])

    def loss_of_batch() -> torch.Tensor:
        chosen = torch.randint(len(x), (BATCH,))
        said = network(x[chosen] + NOISE * torch.randn(BATCH, sizes[0]))[:, 0]
        return (binary_cross_entropy_with_logits(said, y[chosen], reduction="none") * w[chosen]).mean()

    *_, loss = learn(network.parameters(), loss_of_batch, STEPS, RATE, warm=30, decay=DECAY)
    print(f"pixels: {len(x)} of {sizes[0]} features, last loss {loss:.4f}", flush=True)
    layers = tuple((one.weight.detach().numpy().T.copy(), one.bias.detach().numpy().copy()) for one in linear)
    return Classifier(mean, spread, layers)


def rates(likely: LikelyShadows, target: np.ndarray) -> tuple[float, float]:
    """Recall and precision of the region that a shape leads to."""
    found, true = regions_touching(likely.probability > SHADOW, likely.shape) & (target >= 0), target > 0.5
    both = float((found & true).sum())
    return both / max(float(true.sum()), 1.0), both / max(float(found.sum()), 1.0)


def good(likely: LikelyShadows, target: np.ndarray) -> bool:
    recall, precision = rates(likely, target)
    return bool((target > 0.5).sum() >= FEWEST_PX and 2 * recall * precision > GOOD * (recall + precision))


def fitted(crops: ShadowCrops, network: NetworkFile, seed: int) -> dict[str, Classifier]:
    """All PARTS: the verdict on each fifth crop, which neither the network nor the other parts have seen."""
    others, own = crops.fifths()
    parts = {"candidate": fit_candidates(others)}
    parts["pixel"] = fit_pixels(others, parts["candidate"], seed)
    found = [(likely, target) for planes, target in own for likely in find_likely_shadows(planes, parts, network)]
    right = np.array([good(likely, target) for likely, target in found], np.float64)
    print(f"verdict: {len(right)} answers, {right.mean():.2f} right", flush=True)
    parts["verdict"] = logistic(np.array([likely.features for likely, _ in found]), right)
    return parts


def report(crops: Sequence[Crop], parts: dict[str, Classifier], network: NetworkFile) -> None:
    """Of held-out crops: recall and precision where there is a shadow, and what is found where there is none."""
    rows = []
    for planes, target in crops:
        best, sure = None, 0.0
        for likely in find_likely_shadows(planes, parts, network):
            said = float(parts["verdict"](likely.features[None])[0])
            best, sure = (likely, said) if said > sure else (best, sure)
        true = (target > 0.5).sum() >= FEWEST_PX
        rows.append((sure, true, *(rates(best, target) if best else (0.0, 0.0))))
    sure, true, recall, precision = np.array(rows, np.float64).T
    for least in (0.3, 0.4, 0.5, 0.6, 0.7):
        taken = sure >= least
        some = taken & (true > 0)
        print(
            f"certain {least}: {true.sum():.0f} shadows, {some.sum()} found, recall {(recall * taken)[true > 0].mean():.2f}, "
            f"precision {precision[some].mean():.2f}; of {(true == 0).sum()} without one {(taken & (true == 0)).sum()} got one",
            flush=True,
        )


def save(parts: dict[str, Classifier], path: Path) -> None:
    arrays = {}
    for name in PARTS:
        arrays |= parts[name].arrays(f"{name}.")
    np.savez_compressed(path, **arrays)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("crops", "train"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--photos", type=Path)
    parser.add_argument("--count", type=int, default=1200)
    parser.add_argument("--paved", type=int, default=0, help="so many more, on blocks between joints")
    parser.add_argument("--held-out", type=int, default=160)
    parser.add_argument("-o", "--output", type=Path, default=Path("shadow.npz"))
    parser.add_argument("--network", type=Path, default=NETWORK)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if given.what == "crops":
        for name, count, seed in (("held_out", given.held_out, HELD_OUT_SEED), ("train", given.count, TRAIN_SEED)):
            print(name, write_shadow_crops(given.folder / name, count, seed, given.photos), "crops")
        number = write_shadow_crops(given.folder / "train", given.paved, PAVED_SEED, given.photos, paved=True)
        print("train", number, "crops with those on paving")
        return
    torch.set_num_threads(1)
    crops = ShadowCrops.of(given.folder / "train")
    network = NetworkFile(given.network, "cpu", threads=1)
    parts = fitted(crops, network, given.seed)
    print(f"{len(crops)} crops, {sum(float((t > 0.5).sum() >= FEWEST_PX) for _, t in crops):.0f} with a shadow")
    report(ShadowCrops.of(given.folder / "held_out"), parts, network)
    save(parts, given.output)


if __name__ == "__main__":
    main()
