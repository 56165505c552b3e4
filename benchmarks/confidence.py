"""The confidence of filled pixels: trained on procedural worlds, and the table of how well it holds on the bench.

    python benchmarks/confidence.py train [--worlds N] [--seed 0]      writes src/dlama/assets/confidence/confidence.npz
    python benchmarks/confidence.py table AFTER.jsonl [BEFORE.jsonl]         of files that `bench.py run` wrote

`table` pools the pixels of all cases of a domain, of a domain's views or removals, and of each |yaw| of the streets: the expected
calibration error (ECE, ten bins of equal width) with the 95 % interval of cases drawn again, the share that is right, what was
predicted, and what is wrong among pixels of at least .5; the areas of sparsification (AUSE) of depth in the order of confidence
and of colour in the order of its expected error, each divided by that of the distance formula.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits

from bench import Table, table_of
from bench import rows_of as lines_of
from dlama.completion.pipeline import complete
from dlama.datasets.frames import RemovalTruth, Truth
from dlama.evaluation.metrics.reliability import BINS, Bins
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.inpainters import confidence as room
from dlama.inpainters import filling
from dlama.training.data.augment import add_depth_faults
from dlama.training.data.samples.world_views import WorldSet
from dlama.worlds.dataset import worlds
from learning import learn
from world_cases import world_case

SETS = 20, 20, 28, 28
"""Worlds of each set that is trained on."""
ESTIMATED_WORLDS = 140
"""Worlds more, each seen once with estimated depth, filled by `auto`."""
KEEP = 5.0
"""Weight, in their training, of what the network said of measured depth before."""
TRAINED_FROM = 500_000
"""First seed of the worlds that are trained on."""
SURE = 0.5
"""Least confidence of the pixels whose wrong share is shown."""
FILLERS = ("layered", "layered", "telea", "migan")
SIZE = 256
YAWS = (10, 20, 30, 45, 60)
MISPLACED = 0.006
"""Of a true picture's width: how far it lies aside at most, as poses and calibrations of real frames are not exact."""
PIXELS = 1500
"""Hole pixels that each filled view gives."""
HIDDEN, STEPS, BATCH, RATE = 24, 2500, 4096, 2e-3
KINDS = "weight", "bias"
LAPLACE = 0.3
"""Weight of the expected errors' likelihood next to the probabilities' cross entropy."""
LOGS = (-6.0, 1.0), (-4.0, 3.0)
"""Limits of the logarithm of an expected error of depth (in filled depths) and of colour (in COLOR_WITHIN levels)."""
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
    off: np.ndarray
    """N: depth error in filled depths (|z - true z| / z, at most 1); NaN where far was filled."""

    @classmethod
    def together(cls, parts: Sequence[Rows]) -> Rows:
        return cls(*(np.concatenate(columns) for columns in zip(*parts)))


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
    finite = np.isfinite(z)
    with np.errstate(invalid="ignore", over="ignore"):
        in_depths = np.where(finite, np.minimum(np.abs(true_z - z) / np.where(finite, z, 1), 1), np.nan)
    painted = color[view.hole][chosen] * gain
    levels = np.abs(painted - truth.color[view.hole][chosen]).mean(1)
    levels = np.where(view.color_hole[view.hole][chosen], levels, 0)
    depth_right = off <= room.DEPTH_WITHIN
    return Rows(
        room.feature_rows(room.features_of_known(view), color, depth).T[chosen],
        np.stack([depth_right & (levels <= room.COLOR_WITHIN), depth_right], 1),
        np.stack([off, levels], 1),
        in_depths,
    )


def as_recorded(rgbd: RGBD, rng: np.random.Generator, misplaced: float = 0.0) -> RGBD:
    """The picture as a camera would have it: less sharp, noisy, brighter or darker, and up to `misplaced` widths aside."""
    picture = cv2.GaussianBlur(rgbd.color.astype(np.float32), (0, 0), rng.uniform(0.4, 1.0))
    picture = picture * rng.uniform(0.95, 1.05) + rng.normal(0, rng.uniform(1, 5), picture.shape)
    shift = np.hstack([np.eye(2), rng.uniform(-misplaced, misplaced, (2, 1)) * rgbd.camera.width])
    color = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    if not misplaced:
        return dataclasses.replace(rgbd, color=color)
    moved = [
        cv2.warpAffine(part, shift, rgbd.camera.wh, flags=how, borderMode=cv2.BORDER_REPLICATE)
        for part, how in ((color, cv2.INTER_LINEAR), (rgbd.depth, cv2.INTER_NEAREST))
    ]
    return dataclasses.replace(rgbd, color=moved[0], depth=moved[1])


def filled_rows(
    truth: Truth, filler: str, faults: bool, rng: np.random.Generator, recorded_by_camera: bool = False
) -> Rows | None:
    """Every view that is filled for a truth."""
    source = add_depth_faults(truth.source, rng, sensor_holes=True) if faults else truth.source
    if recorded_by_camera:
        source = as_recorded(source, rng)
    if isinstance(truth, RemovalTruth):
        frames, mask, camera = [truth.without], truth.mask, truth.source.camera
    else:
        frames, mask, camera = [truth.target], None, truth.target.camera
    if recorded_by_camera:
        frames = [as_recorded(frame, rng, MISPLACED) for frame in frames]
    parts: list[Rows] = []

    def recorded(
        view: View, color: np.ndarray, depth: np.ndarray, known: object = None
    ) -> tuple[np.ndarray, np.ndarray]:
        for frame in frames:
            if frame.camera.same_view_as(view.camera) and view.color_hole.any():
                parts.append(rows_of(view, color, depth, frame, gain_of(view, frame, truth.exposure_varies), rng))
        return view.confidence, np.zeros((*view.hole.shape, 2), np.float32)

    kept, filling.judge_fill = filling.judge_fill, recorded
    try:
        complete(source, [camera], mask=mask, filler=filler)
    finally:
        filling.judge_fill = kept
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
            found = filled_rows(case.load(), filler, number % 4 > 0, rng, number % 2 > 0)
            if found is not None:
                yield found
        print(f"\r{number + 1} worlds", end="", flush=True)
    print()


def estimated_rows(count: int, seed: int) -> Iterator[Rows]:
    """Rows of worlds whose depth is estimated from the picture, at the true scale: a view and a removal in turn."""
    rng, training = np.random.default_rng(seed), WorldSet("train", SIZE)
    for number in range(count):
        truth = world_case(number, ("view", "removal")[number % 2], "estimated", training, int(rng.integers(100)))
        found = filled_rows(truth, "auto", False, rng, number // 2 % 2 > 0)
        if found is not None:
            yield found
        print(f"\r{number + 1} worlds with estimated depth", end="", flush=True)
    print()


def train(
    rows: Rows, seed: int, start: dict[str, np.ndarray] | None = None, kept: Rows | None = None
) -> dict[str, np.ndarray]:
    """Weights: the cross entropy of both probabilities, and the Laplace likelihood of both errors, log b + |e| / b, whose best b
    is the mean of |e|.

    With `start`, weights trained before, training continues with `rows`; of `kept` the network says what it said at the start.
    """
    torch.manual_seed(seed)
    mean, spread = rows.features.mean(0), rows.features.std(0) + 1e-3
    mean[-1], spread[-1] = 0, 1
    if start is not None:
        mean, spread = start["mean"], start["spread"]
    x_all, *truth = training_data(rows, mean, spread)
    sizes = (room.FEATURES, HIDDEN, HIDDEN, room.OUTPUTS)
    layers = [nn.Linear(*pair) for pair in itertools.pairwise(sizes)]
    network = nn.Sequential(layers[0], nn.ReLU(), layers[1], nn.ReLU(), layers[2])
    noise, decay, rate, steps = (NOISE, DECAY, RATE, STEPS) if start is None else (NOISE / 3, 0.0, RATE / 2, 2 * STEPS)
    for k, layer in enumerate(layers):
        nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
        nn.init.zeros_(layer.bias)
        if start is not None:
            layer.weight.data, layer.bias.data = (torch.from_numpy(start[f"{kind}{k}"].T.copy()) for kind in KINDS)
    x_kept, out_kept = x_all[:0], torch.zeros(0, room.OUTPUTS)
    if kept is not None:
        x_kept = training_data(kept, mean, spread)[0]
        out_kept = network(x_kept).detach()
    half = BATCH // 2 if kept is not None else BATCH
    shaken = noise * torch.tensor([1.0] * (room.FEATURES - 1) + [float(start is None)])

    def loss_of_batch() -> Tensor:
        drawn = torch.randint(len(x_all), (half,))
        loss = loss_of(
            network(x_all[drawn] + shaken * torch.randn(half, room.FEATURES)), *(part[drawn] for part in truth)
        )
        if kept is not None:
            again = torch.randint(len(x_kept), (BATCH - half,))
            loss = loss + KEEP * loss_from(network(x_kept[again]), out_kept[again])
        return loss / BATCH

    for step, loss in enumerate(learn(network.parameters(), loss_of_batch, steps, rate, decay=decay), 1):
        if step % 500 == 0:
            print(f"step {step}: loss {loss:.4f}")
    named = {f"{kind}{k}": getattr(layer, kind).detach().numpy().T for k, layer in enumerate(layers) for kind in KINDS}
    return {"mean": mean.astype(np.float32), "spread": spread.astype(np.float32), **named}


def training_data(rows: Rows, mean: np.ndarray, spread: np.ndarray) -> list[Tensor]:
    """Inputs in standard deviations, what is right, errors in the network's units, and 1 where an error counts (far and measured
    ones do not)."""
    x = np.clip((rows.features - mean) / spread, -room.REACH, room.REACH)
    far, levels = np.isnan(rows.off), rows.errors[:, 1]
    errors = np.stack([np.where(far, 0, rows.off), levels / room.COLOR_WITHIN], 1)
    parts = x, rows.right, errors, np.stack([~far, levels > 0], 1)
    return [torch.from_numpy(part.astype(np.float32)) for part in parts]


def loss_of(out: Tensor, right: Tensor, errors: Tensor, counted: Tensor) -> Tensor:
    """The sum over N rows."""
    low, high = torch.tensor(LOGS).T
    logs = out[:, 2:].clamp(low, high)
    off = (counted * (logs + errors * torch.exp(-logs))).sum()
    return binary_cross_entropy_with_logits(out[:, :2], right, reduction="sum") + LAPLACE * off


def loss_from(out: Tensor, expected: Tensor) -> Tensor:
    """The same for rows of which the network is to say what it said: `expected`."""
    off = 0.5 * (out - expected)[:, 2:].square().sum()
    return binary_cross_entropy_with_logits(out[:, :2], expected[:, :2].sigmoid(), reduction="sum") + LAPLACE * off


def pooled(cases: Sequence[dict[str, float]]) -> Bins:
    """The bins of all cases together, each counted alike."""
    columns = (np.mean([[case[f"bin_{k}_{name}"] for k in range(BINS)] for case in cases], 0) for name in Bins._fields)
    return Bins(*columns)


def groups_of(table: Table, rows: list[dict], method: str) -> dict[str, list[dict[str, float]]]:
    """The measures of the cases of each domain, each kind of a domain, and each |yaw|."""
    found = defaultdict(list)
    yaws = {row["case"]: row.get("yaw") for row in rows if "case" in row}
    domains = {row["case"]: row["domain"] for row in rows if "case" in row}
    for case, measures in table[method].items():
        if "ece" in measures:
            kind = "removals" if "/ori/" in case else "views"
            names = ["all", domains[case], f"{domains[case]}, {kind}"]
            names += [f"|yaw| {abs(yaws[case]):.0f}"] if yaws[case] and names[2] == "street, views" else []
            for name in names:
                found[name].append(measures)
    return dict(sorted(found.items()))


def show(path: Path, method: str) -> None:
    """The table of one file."""
    rows, rng = lines_of(path), np.random.default_rng(0)
    print(
        f"\n{path}\n| cases of | n | right | predicted | ECE (95 %) | wrong of >= {SURE} | AUSE depth | AUSE colour |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name, cases in groups_of(table_of(rows)[0], rows, method).items():
        bins = pooled(cases)
        drawn = [pooled([cases[k] for k in rng.integers(len(cases), size=len(cases))]).error for _ in range(300)]
        low, high = np.percentile(drawn, (2.5, 97.5))
        sure = slice(int(SURE * BINS), None)
        wrong = 1 - bins.right[sure].sum() / max(bins.share[sure].sum(), 1e-9)
        ratios = [
            np.nanmean([case.get(f"ause_{of}", np.nan) for case in cases])
            / np.nanmean([case.get(f"ause_{of}_distance", np.nan) for case in cases])
            for of in ("depth", "color")
        ]
        print(
            f"| {name} | {len(cases)} | {bins.right.sum():.2f} | {bins.predicted.sum():.2f} | {bins.error:.3f} "
            f"({low:.2f} to {high:.2f}) | {wrong:.2f} of {bins.share[sure].sum():.2f} | {ratios[0]:.2f} | {ratios[1]:.2f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True, dest="what")
    one = verbs.add_parser("train")
    one.add_argument("--worlds", type=int)
    one.add_argument("--seed", type=int, default=0)
    two = verbs.add_parser("table")
    two.add_argument("files", type=Path, nargs="+")
    two.add_argument("--method", default="dlama/auto")
    asked = parser.parse_args()
    if asked.what == "table":
        for path in asked.files:
            show(path, asked.method)
        return
    sets = SETS if asked.worlds is None else (asked.worlds,)
    parts = [part for number, count in enumerate(sets) for part in world_rows(count, asked.seed + number, TRAINED_FROM)]
    rows = Rows.together(parts)
    weights = train(rows, asked.seed)
    estimated = Rows.together(list(estimated_rows(asked.worlds or ESTIMATED_WORLDS, asked.seed)))
    weights = train(estimated, asked.seed, weights, kept=rows)
    room.WEIGHTS.parent.mkdir(exist_ok=True)
    np.savez(room.WEIGHTS, **weights)
    print(f"{room.WEIGHTS}: {sum(array.size for array in weights.values())} numbers")


if __name__ == "__main__":
    main()
