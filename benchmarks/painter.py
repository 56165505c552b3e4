"""MI-GAN's generator tuned on the holes that removals leave: photos and worlds (`painter_crops`) in, the network's file out.

    python benchmarks/painter.py worlds FOLDER --photos ../shared/photos
    python benchmarks/painter.py train FOLDER --photos ../shared/photos --start FILE -o RUN --minutes 60 [--resume]
    python benchmarks/painter.py export RUN --start FILE -o src/dlama/assets/migan/migan-512-tuned.onnx

`train` begins at the generator of --start (a file of `migan_export`) and keeps its structure; what is exported is the running
mean of its weights. Every few minutes it is measured on held-out photos and worlds: mean absolute and squared error in levels,
LPIPS in the hole; some of them are written as a picture.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor

from bench import lpips_map
from dlama.geometry.rgbd import UInt8Array
from dlama.training.data.photos import folder_photos, split_photos
from painter_crops import Crop, outlines_of, photo_crop, world_crop, write_worlds
from painter_network import Generator, Run

WORLDS, LEARNT_WORLDS, OUTLINES = 900, 800, 600
SIDE, BATCH, LARGE_SIDE, LARGE_BATCH, LARGE = 256, 4, 384, 2, 0.2
"""Pixels and number of crops of a batch, and of so large a share of all batches."""
OF_WORLDS = 0.3
"""Share of crops."""
MEASURED_PHOTOS, MEASURED_WORLDS, SHOWN_EVERY = 48, 32, 4


class Crops:
    """What is learnt from, and what is held out, of a folder of worlds and a folder of photos."""

    def __init__(self, worlds: Path, photos: Path) -> None:
        found, files = folder_photos(photos), sorted(worlds.glob("*.npz"))
        self.photos = split_photos(found, "train")
        self.worlds, held_out = files[:LEARNT_WORLDS], files[LEARNT_WORLDS:]
        rng = np.random.default_rng(99)
        self.outlines = outlines_of([self.photos[place] for place in rng.permutation(len(self.photos))[:OUTLINES]])
        kept = split_photos(found, "held_out")
        self.held_out = [photo_crop(kept, self.outlines, SIDE, rng) for _ in range(MEASURED_PHOTOS)]
        self.held_out += [world_crop([file], LARGE_SIDE, rng) for file in held_out[:MEASURED_WORLDS]]

    def batches(self, rng: np.random.Generator) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """Without end: colours and truth (B x 3 x S x S, 0..1), hole (B x 1 x S x S); half of the crops are mirrored."""
        while True:
            side, count = (LARGE_SIDE, LARGE_BATCH) if rng.random() < LARGE else (SIDE, BATCH)
            crops = [self._crop(side, rng) for _ in range(count)]
            crops = [Crop(*(plane[:, ::-1] for plane in one)) if rng.random() < 0.5 else one for one in crops]
            yield (
                tensor_of([one.color for one in crops]) / 255,
                tensor_of([one.truth for one in crops]) / 255,
                tensor_of([one.hole[..., None] for one in crops]),
            )

    def _crop(self, side: int, rng: np.random.Generator) -> Crop:
        if rng.random() < OF_WORLDS:
            return world_crop(self.worlds, side, rng)
        return photo_crop(self.photos, self.outlines, side, rng)


def tensor_of(planes: Sequence[np.ndarray]) -> Tensor:
    """Crops H x W x C -> B x C x H x W, float32."""
    stacked = torch.from_numpy(np.stack(planes).astype(np.float32))
    return stacked.permute(0, 3, 1, 2)


def fill(generator: Generator, crop: Crop) -> UInt8Array:
    """S x S x 3: the crop's truth with its hole as painted."""
    with torch.no_grad():
        out = generator.fill(tensor_of([crop.color]) / 255, tensor_of([crop.hole[..., None]]))[0]
    painted = np.round(out.clamp(0, 1).permute(1, 2, 0).numpy() * 255)
    return np.where(crop.hole[..., None], painted, crop.truth).astype(np.uint8)


def errors(filled: UInt8Array, crop: Crop) -> tuple[float, float, float]:
    """Mean absolute and squared error in levels, and LPIPS, in the hole."""
    truth = crop.truth.astype(np.uint8)
    off = (filled.astype(np.float32) - truth)[crop.hole]
    distance = lpips_map(truth, filled, crop.hole)[crop.hole]
    return float(np.abs(off).mean()), float(np.square(off).mean()), float(distance.mean())


def measure(run: Run, crops: Sequence[Crop], sheet: Path) -> str:
    """The errors of photos and of worlds, and a picture of known, filled and true crops."""
    filled = [fill(run.averaged, crop) for crop in crops]
    found = np.array([errors(one, crop) for one, crop in zip(filled, crops)])
    rows = [
        np.hstack([cv2.resize(each, (SIDE, SIDE)) for each in (np.where(crop.hole[..., None], 0, crop.color), one, crop.truth)])
        for one, crop in list(zip(filled, crops))[::SHOWN_EVERY]
    ]  # fmt: skip
    cv2.imwrite(str(sheet), np.vstack(rows)[..., ::-1].astype(np.uint8))
    parts = found[:MEASURED_PHOTOS], found[MEASURED_PHOTOS:]
    return "  ".join("{:6.2f} {:7.1f} {:.4f}".format(*part.mean(0)) for part in parts)


def make_worlds(asked: argparse.Namespace) -> None:
    """Once, for all runs."""
    write_worlds(asked.folder, WORLDS, split_photos(folder_photos(asked.photos), "train"))


def train(asked: argparse.Namespace) -> None:
    """Learn for asked.minutes, measured in asked.looks parts."""
    torch.manual_seed(asked.seed)
    crops, run = Crops(asked.folder, asked.photos), Run(asked.start)
    asked.output.mkdir(parents=True, exist_ok=True)
    state = asked.output / "state.pt"
    if asked.resume:
        run.load(state)
    rng = np.random.default_rng([asked.seed, run.step])
    print(f"step {run.step}: photos, worlds {measure(run, crops.held_out, asked.output / 'start.png')}", flush=True)
    batches = crops.batches(rng)
    for _ in range(asked.looks):
        started, losses = time.monotonic(), []
        while time.monotonic() - started < 60 * asked.minutes / asked.looks:
            losses.append(run.learn(next(batches), rng))
        run.save(state)
        found = measure(run, crops.held_out, asked.output / f"{run.step:06}.png")
        print(f"step {run.step}: {np.mean(losses, 0).round(4)} {found}", flush=True)


def export(asked: argparse.Namespace) -> None:
    """The running mean as a file like that of --start."""
    run = Run(asked.start)
    run.load(asked.run / "state.pt")
    run.averaged.write(asked.start, asked.output)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True)
    one = verbs.add_parser("worlds")
    one.add_argument("folder", type=Path)
    one.add_argument("--photos", type=Path, required=True)
    one.set_defaults(do=make_worlds)
    two = verbs.add_parser("train")
    two.add_argument("folder", type=Path, help="of worlds")
    two.add_argument("--photos", type=Path, required=True)
    two.add_argument("--start", type=Path, required=True)
    two.add_argument("-o", "--output", type=Path, required=True)
    two.add_argument("--minutes", type=float, default=60)
    two.add_argument("--looks", type=int, default=6)
    two.add_argument("--seed", type=int, default=0)
    two.add_argument("--resume", action="store_true")
    two.set_defaults(do=train)
    three = verbs.add_parser("export")
    three.add_argument("run", type=Path)
    three.add_argument("--start", type=Path, required=True)
    three.add_argument("-o", "--output", type=Path, required=True)
    three.set_defaults(do=export)
    asked = parser.parse_args()
    asked.do(asked)


if __name__ == "__main__":
    main()
