"""The judge of filler `choice`: crops with guesses to train it on, and what it gives on held-out ones.

    python benchmarks/choice.py crops FOLDER [--photos ../shared/photos] [--count 1200] [--held-out 40] [--seed 0]
    dlama train choice -o RUN --data FOLDER
    python benchmarks/choice.py measure FOLDER [--judge RUN/choice.onnx]

`measure` prints, over the holes of the held-out crops: mean absolute and squared error of colour (0..1), LPIPS over the share of
the hole, and the mean absolute error of normalised inverse depth: of each guess, of their mean, of the judge's mixture
without and with the rules of `inpainters.choice.priors`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from dlama.evaluation.metrics.lpips import Lpips
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.inpainters.choice.filler import JUDGE
from dlama.inpainters.choice.judge import open_judge, run_judge
from dlama.inpainters.choice.mixing import choose_depth, mix_colors
from dlama.inpainters.choice.planes import JudgePlanes
from dlama.inpainters.choice.priors import with_priors
from dlama.training.data.photos import folder_photos, split_photos
from dlama.training.data.samples.guesses import INDEX, LEVELS, GuessCrop, read_crop
from guess_crops import write_crops


def make(asked: argparse.Namespace) -> None:
    photos = folder_photos(asked.photos) if asked.photos else ()
    for split, count, seed in (("held_out", asked.held_out, asked.seed + 5000), ("train", asked.count, asked.seed)):
        made = write_crops(asked.folder, count, split_photos(photos, split) if photos else (), seed, split)
        print(f"{asked.folder / split}: {made} crops")


def planes_of(crop: GuessCrop) -> JudgePlanes:
    """What the judge sees of a crop."""
    context = np.asarray(crop.context / np.float32(255), np.float32)
    known, *depths = crop.depth / np.float32(LEVELS)
    context[3] = known
    context[:3] *= 1 - context[-1]
    guesses = np.concatenate([crop.color / np.float32(255), np.stack(depths)[:, None]], 1)
    return JudgePlanes(context, np.asarray(guesses, np.float32))


def answers(crop: GuessCrop, names: list[str], judge: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Name -> colours (S x S x 3) and normalised inverse depth (S x S)."""
    planes, depths = planes_of(crop), list(crop.depth[1:] / np.float32(LEVELS))
    colors = [np.ascontiguousarray(one.transpose(1, 2, 0)) for one in crop.color]
    found: dict[str, tuple[np.ndarray, np.ndarray]] = dict(zip(names, zip(colors, depths)))
    found["mean"] = np.asarray(np.round(np.mean(colors, 0)), np.uint8), np.asarray(np.mean(depths, 0))
    hw, alone = planes.context.shape[1:], run_judge(open_judge(judge), planes)
    for name, verdict in (("judge alone", alone), ("with its rules", with_priors(alone, names, planes))):
        color = mix_colors(colors, planes.guesses[:, :3], verdict.base, verdict.detail, hw)
        taken = choose_depth(verdict.depth, depths, crop.context[-1] > 0, hw)
        found[name] = color, np.take_along_axis(np.stack(depths), taken[None], 0)[0]
    return found


def color_errors(color: UInt8Array, truth: UInt8Array, hole: BoolArray, lpips: Lpips) -> tuple[float, float, float]:
    """Of colours (H x W x 3) in the hole (H x W): mean absolute and squared error (0..1), LPIPS over the share of the hole."""
    shown = np.where(hole[..., None], color, truth)
    off = (shown.astype(np.float32) - truth)[hole] / 255
    taps = zip(lpips.features(shown), lpips.features(truth))
    distance = sum(float(((a - b) ** 2).sum(0).mean()) for a, b in taps)
    return float(np.abs(off).mean()), float((off**2).mean()), distance / float(hole.mean())


def measure(asked: argparse.Namespace) -> None:
    folder, lpips = asked.folder / "held_out", Lpips()
    names = (folder / INDEX).read_text("utf-8").split()
    rows: dict[str, list[tuple[float, ...]]] = {}
    for path in sorted(folder.glob("*.npz")):
        crop = read_crop(path)
        hole, depth_hole = crop.context[-2] > 0, (crop.context[-1] > 0) & (crop.true_known > 0)
        if hole.mean() < 0.01:
            continue
        truth = np.ascontiguousarray(crop.true_color.transpose(1, 2, 0))
        for name, (color, depth) in answers(crop, names, asked.judge).items():
            wrong = np.abs(depth - crop.true_depth / LEVELS)[depth_hole].mean() if depth_hole.any() else np.nan
            rows.setdefault(name, []).append((*color_errors(color, truth, hole, lpips), wrong))
    print("                     L1     MSE   LPIPS   depth")
    for name, values in rows.items():
        print(f"{name:16}", *(f"{value:7.4f}" for value in np.nanmean(values, 0)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("crops", "measure"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--photos", type=Path)
    parser.add_argument("--count", type=int, default=1200)
    parser.add_argument("--held-out", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--judge", type=Path, default=JUDGE)
    asked = parser.parse_args()
    (make if asked.what == "crops" else measure)(asked)


if __name__ == "__main__":
    main()
