"""The confidence of filled pixels: trained on procedural worlds, and held against the truth there and elsewhere.

    python benchmarks/confidence.py train [--worlds 56] [--seed 0]      writes src/dlama/assets/confidence/confidence.npz
    python benchmarks/confidence.py measure [--worlds 8] [--data ../shared]

`measure` prints, for held-out worlds and for the street and kitchen data where they are there: the expected calibration error
(ECE, ten bins of equal width) of this confidence and of the distance formula that it replaced, and the area between the
sparsification curve and the one an oracle would give (AUSE, in units of the mean error) for depth and colour, of both and of a
random order; the ratio is that of the first two.
"""

from __future__ import annotations

import argparse
import itertools
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from dlama.completion.pipeline import complete
from dlama.datasets.frames import Case, RemovalTruth
from dlama.datasets.layouts import open_dataset
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.inpainters import confidence as room
from dlama.inpainters import filling
from dlama.training.data.augment import with_faults
from dlama.worlds.dataset import worlds

TRAINED_FROM, HELD_OUT_FROM = 500_000, 700_000
"""First seeds of the worlds that are trained on, and of those that are not."""
FILLERS = ("layered", "layered", "telea")
SIZE = 256
YAWS = (10, 20, 30, 45, 60)
PIXELS = 1500
"""Hole pixels that each filled view gives."""
HIDDEN, STEPS, BATCH, RATE = 12, 1500, 4096, 2e-3
NOISE, DECAY = 0.3, 0.1
"""Of features (in standard deviations) and of weights (times the rate): without them a few worlds are learned by heart."""


class Rows(NamedTuple):
    """Filled pixels."""

    features: np.ndarray
    """N x FEATURES."""
    right: np.ndarray
    """N x 2 bool: depth and colour right; depth right."""
    errors: np.ndarray
    """N x 2: relative depth error (clipped at 1), colour error in levels (mean over channels)."""
    formula: np.ndarray
    """N: confidence by distance, as it was before."""

    @classmethod
    def together(cls, parts: Sequence[Rows]) -> Rows:
        return cls(*(np.concatenate(columns) for columns in zip(*parts)))


def by_distance(view: View) -> np.ndarray:
    """H x W: 0.5 at the rim (0.75 where colour is measured), halved every 5 % of the diagonal: the formula before."""
    distance = cv2.distanceTransform(view.hole.astype(np.uint8), cv2.DIST_L2, 5)
    top = np.where(view.color_hole, 0.5, 0.75)
    return top * np.exp2(-distance / (0.05 * np.hypot(*view.hole.shape)))


def rows_of(
    view: View, color: np.ndarray, depth: np.ndarray, truth: RGBD, gain: np.ndarray, rng: np.random.Generator
) -> Rows:
    """The view's filled pixels whose truth is known, at most PIXELS of them."""
    known = (truth.depth > 0)[view.hole]
    chosen = np.flatnonzero(known)
    chosen = rng.permutation(chosen)[:PIXELS]
    z, true_z = depth[view.hole][chosen], truth.depth[view.hole][chosen]
    both_far = np.isinf(z) & np.isinf(true_z)
    with np.errstate(invalid="ignore"):
        off = np.where(both_far, 0, np.abs(z - true_z) / np.where(np.isinf(true_z), 1, true_z))
    off = np.minimum(np.where(np.isfinite(off) & np.isfinite(true_z) | both_far, off, 1), 1)
    painted = color[view.hole][chosen] * gain
    levels = np.abs(painted - truth.color[view.hole][chosen]).mean(1)
    levels = np.where(view.color_hole[view.hole][chosen], levels, 0)
    depth_right = off <= room.DEPTH_WITHIN
    return Rows(
        room.fill_features(view, color, depth)[chosen],
        np.stack([depth_right & (levels <= room.COLOR_WITHIN), depth_right], 1),
        np.stack([off, levels], 1),
        by_distance(view)[view.hole][chosen],
    )


def filled_rows(case: Case, filler: str, faults: bool, rng: np.random.Generator) -> Rows | None:
    """Every view that is filled for a case, with its truth."""
    truth = case.load()
    source = with_faults(truth.source, rng, sensor_holes=True) if faults else truth.source
    if isinstance(truth, RemovalTruth):
        frames, mask, camera = [truth.without], truth.mask, truth.source.camera
    else:
        frames, mask, camera = [truth.target], None, truth.target.camera
    parts: list[Rows] = []

    def recorded(view: View, color: np.ndarray, depth: np.ndarray) -> np.ndarray:
        for frame in frames:
            if frame.camera.same_view_as(view.camera) and view.color_hole.any():
                parts.append(rows_of(view, color, depth, frame, gain_of(view, frame, truth.exposure_varies), rng))
        return view.confidence

    kept, filling.fill_confidence = filling.fill_confidence, recorded
    try:
        complete(source, [camera], mask=mask, filler=filler)
    finally:
        filling.fill_confidence = kept
    return Rows.together(parts) if parts else None


def gain_of(view: View, frame: RGBD, varies: bool) -> np.ndarray:
    """One gain per channel between the exposures, from the pixels that both show."""
    seen = ~view.hole
    if not varies or not seen.any():
        return np.ones(3)
    return np.asarray(np.median(frame.color[seen], 0) / np.maximum(np.median(view.color[seen], 0), 1))


def world_rows(count: int, seed: int, first: int) -> Iterator[Rows]:
    """Rows of `count` worlds: views and removals, three of four with sensor faults, fillers in turn."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        cases = worlds(1, seed=first + 1000 * seed + number, size=SIZE, yaws=YAWS).cases
        views = [case for case in cases if case.protocol == "vpi"]
        removals = [case for case in cases if case.protocol == "ori"]
        for case in [*rng.permutation(np.array(views, object))[:4], *rng.permutation(np.array(removals, object))[:2]]:
            filler = FILLERS[int(rng.integers(len(FILLERS)))]
            found = filled_rows(case, filler, number % 4 > 0, rng)
            if found is not None:
                yield found
        print(f"\r{number + 1} worlds", end="", flush=True)
    print()


def train(rows: Rows, seed: int) -> dict[str, np.ndarray]:
    """Weights by Adam on the cross entropy of both outputs."""
    rng = np.random.default_rng(seed)
    mean, spread = rows.features.mean(0), rows.features.std(0) + 1e-3
    x_all, y_all = ((rows.features - mean) / spread).astype(np.float32), rows.right.astype(np.float32)
    sizes = (room.FEATURES, HIDDEN, HIDDEN, 2)
    weights = [rng.normal(0, np.sqrt(2 / a), (a, b)).astype(np.float32) for a, b in itertools.pairwise(sizes)]
    numbers = [part for weight in weights for part in (weight, np.zeros(weight.shape[1], np.float32))]
    first, second = [np.zeros_like(n) for n in numbers], [np.zeros_like(n) for n in numbers]
    for step in range(1, STEPS + 1):
        pick = rng.integers(0, len(x_all), BATCH)
        activations = [x_all[pick] + NOISE * rng.standard_normal((BATCH, room.FEATURES), np.float32)]
        for k in range(3):
            out = activations[-1] @ numbers[2 * k] + numbers[2 * k + 1]
            activations.append(np.maximum(out, 0) if k < 2 else 1 / (1 + np.exp(-out)))
        error = (activations[3] - y_all[pick]) / BATCH
        gradients: list[np.ndarray] = []
        for k in (2, 1, 0):
            gradients = [activations[k].T @ error, error.sum(0), *gradients]
            error = (error @ numbers[2 * k].T) * (activations[k] > 0)
        rate = RATE * 0.5 * (1 + np.cos(np.pi * step / STEPS))
        for n, g, m, v in zip(numbers, gradients, first, second):
            m += 0.1 * (g - m)
            v += 0.001 * (g * g - v)
            n -= (rate * (m / (1 - 0.9**step) / (np.sqrt(v / (1 - 0.999**step)) + 1e-8) + DECAY * n)).astype(np.float32)
        if step % 500 == 0:
            p = np.clip(activations[3], 1e-6, 1 - 1e-6)
            y = y_all[pick]
            print(f"step {step}: cross entropy {-(y * np.log(p) + (1 - y) * np.log(1 - p)).mean():.4f}")
    named = {f"{kind}{k}": numbers[2 * k + place] for k in range(3) for place, kind in enumerate(("weight", "bias"))}
    return {"mean": mean.astype(np.float32), "spread": spread.astype(np.float32), **named}


def calibration_error(p: np.ndarray, right: np.ndarray) -> float:
    """Expected calibration error over ten bins of equal width."""
    bins = np.minimum((p * 10).astype(int), 9)
    return sum(abs(p[bins == b].mean() - right[bins == b].mean()) * (bins == b).mean() for b in np.unique(bins))


def sparsification_area(order: np.ndarray, error: np.ndarray) -> float:
    """Area between the curve (mean error of what is left when the least sure are taken away) and the oracle's, in mean errors."""

    def curve(by: np.ndarray) -> np.ndarray:
        kept = error[np.argsort(by, kind="stable")]  # least sure first
        sums = np.cumsum(kept[::-1])[::-1] / np.arange(len(kept), 0, -1)
        return sums[(np.linspace(0, 0.99, 100) * len(kept)).astype(int)] / max(error.mean(), 1e-9)

    return float((curve(order) - curve(-error)).mean())


def shown(name: str, rows: Rows) -> None:
    p = room.confidence_network()(rows.features)[:, 0]
    right = rows.right[:, 0]
    noise = np.random.default_rng(0).random(len(p))
    areas = [[sparsification_area(order, rows.errors[:, k]) for order in (p, rows.formula, noise)] for k in range(2)]
    errors = f"{calibration_error(p, right):6.3f} {calibration_error(rows.formula, right):7.3f}"
    parts = [f" {a:6.3f} {b:7.3f} {c:6.3f} {a / b:6.2f}" for a, b, c in areas]
    print(f"{name:22} {len(p):8} {right.mean():6.3f} | {errors} |{' |'.join(parts)}", flush=True)


def measured(count: int, data: Path | None) -> None:
    print(
        "                         pixels  right |  ECE  formula | AUSE depth, formula, random, ratio | AUSE colour, likewise"
    )
    shown("worlds, held out", Rows.together(list(world_rows(count, 0, HELD_OUT_FROM))))
    if data is None:
        return
    rng = np.random.default_rng(0)
    for name, folder in (("street", data / "street"), ("kitchen_vpi", data / "data" / "kitchen_vpi")):
        cases = [
            case
            for case in open_dataset(folder).of("vpi")
            if case.yaw is None or name != "street" or abs(case.yaw) in (10, 30, 60)
        ]
        for filler in ("layered", "migan"):
            parts = [filled_rows(case, filler, False, rng) for case in cases]
            shown(f"{name}, {filler}", Rows.together([part for part in parts if part is not None]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("train", "measure"))
    parser.add_argument("--worlds", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--data", type=Path, default=os.environ.get("DLAMA_DATA"))
    asked = parser.parse_args()
    if asked.what == "measure":
        measured(asked.worlds or 8, asked.data and Path(asked.data))
        return
    weights = train(Rows.together(list(world_rows(asked.worlds or 56, asked.seed, TRAINED_FROM))), asked.seed)
    room.WEIGHTS.parent.mkdir(exist_ok=True)
    np.savez(room.WEIGHTS, **weights)
    print(f"{room.WEIGHTS}: {sum(array.size for array in weights.values())} numbers")


if __name__ == "__main__":
    main()
