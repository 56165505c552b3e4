"""MI-GAN's generator tuned on the holes that removals and views leave: photos and worlds (`painter_crops`) in, the network's file
out.

    python benchmarks/painter.py worlds FOLDER --photos ../shared/photos
    python benchmarks/painter.py train FOLDER --photos ../shared/photos --start FILE -o RUN --minutes 60 [--resume]
    python benchmarks/painter.py export RUN --start FILE -o FILE
    python benchmarks/painter.py mean FILE FILE --share 0.33 -o src/dlama/assets/migan/migan-512-tuned.onnx

`train` begins at the generator of --start (a file of `migan_export`) and keeps its structure; what is exported is the running
mean of its weights. Every few minutes it is measured on held-out photos, worlds and views: mean absolute and squared error in
levels, LPIPS in the hole; some of them are written as a picture. `mean` is that of two files' weights. The file that ships is the
mean of a run of 1,950 steps with photos and worlds alone (2/3) and of the 1,440 steps that went on from it with views and depth
(1/3): the second is better in views, the first behind removed objects.
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
from dlama.datasets.text_tables import pictures_below
from dlama.geometry.rgbd import UInt8Array
from dlama.training.data.photos import split_photos
from painter_crops import VIEW_SIDE, Crop, outlines_of, photo_crop, stored_crop, write_views, write_worlds
from painter_network import Generator, Run

WORLDS, VIEWS, OUTLINES = 900, 400, 600
SIDE, BATCH, LARGE_SIDE, LARGE_BATCH, LARGE = 256, 4, 384, 2, 0.2
"""Pixels and number of crops of a batch, and of so large a share of all batches."""
OF_WORLDS, OF_VIEWS = 0.2, 0.3
"""Shares of crops; views are of no large batch."""
MEASURED, SHOWN_EVERY = {"photos": 48, "worlds": 32, "views": 48}, 4


class Crops:
    """What is learnt from, and what is held out, of a folder of worlds and views and a folder of photos."""

    def __init__(self, folder: Path, photos: Path) -> None:
        found = pictures_below(photos)
        worlds, views = (sorted((folder / name).glob("*.npz")) for name in ("worlds", "views"))
        self.photos = split_photos(found, "train")
        self.worlds, self.views = worlds[: -MEASURED["worlds"]], views[: -MEASURED["views"]]
        rng = np.random.default_rng(99)
        self.outlines = outlines_of([self.photos[place] for place in rng.permutation(len(self.photos))[:OUTLINES]])
        kept = split_photos(found, "held_out")
        self.held_out = {
            "photos": [photo_crop(kept, self.outlines, SIDE, rng) for _ in range(MEASURED["photos"])],
            "worlds": [stored_crop([file], LARGE_SIDE, rng) for file in worlds[-MEASURED["worlds"] :]],
            "views": [stored_crop([file], VIEW_SIDE, rng) for file in views[-MEASURED["views"] :]],
        }

    def batches(self, rng: np.random.Generator) -> Iterator[tuple[Tensor, Tensor, Tensor, Tensor]]:
        """Without end: colours and truth (B x 3 x S x S, 0..1), hole and its counted part (B x 1 x S x S); half of the crops
        are mirrored."""
        while True:
            side, count = (LARGE_SIDE, LARGE_BATCH) if rng.random() < LARGE else (SIDE, BATCH)
            crops = [self._crop(side, rng) for _ in range(count)]
            crops = [Crop(*(plane[:, ::-1] for plane in one)) if rng.random() < 0.5 else one for one in crops]
            yield (
                tensor_of([one.color for one in crops]) / 255,
                tensor_of([one.truth for one in crops]) / 255,
                tensor_of([one.hole[..., None] for one in crops]),
                tensor_of([one.counted[..., None] for one in crops]),
            )

    def _crop(self, side: int, rng: np.random.Generator) -> Crop:
        drawn = rng.random()
        if drawn < OF_WORLDS:
            return stored_crop(self.worlds, side, rng)
        if drawn < OF_WORLDS + OF_VIEWS and side <= VIEW_SIDE:
            return stored_crop(self.views, side, rng)
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
    return np.where(crop.counted[..., None], painted, crop.truth).astype(np.uint8)


def errors(filled: UInt8Array, crop: Crop) -> tuple[float, float, float]:
    """Mean absolute and squared error in levels, and LPIPS, where the truth of the hole is known."""
    truth = crop.truth.astype(np.uint8)
    off = (filled.astype(np.float32) - truth)[crop.counted]
    distance = lpips_map(truth, filled, crop.counted)[crop.counted]
    return float(np.abs(off).mean()), float(np.square(off).mean()), float(distance.mean())


def measure(run: Run, held_out: dict[str, list[Crop]], sheet: Path) -> str:
    """The errors of each kind of crops, and a picture of known, filled and true ones."""
    rows, said = [], []
    for kind, crops in held_out.items():
        filled = [fill(run.averaged, crop) for crop in crops]
        found = np.mean([errors(one, crop) for one, crop in zip(filled, crops)], 0)
        said.append("{} {:.2f} {:.1f} {:.4f}".format(kind, *found))
        for one, crop in list(zip(filled, crops))[::SHOWN_EVERY]:
            shown = np.where(crop.hole[..., None], 0, crop.color), one, crop.truth
            rows.append(np.hstack([cv2.resize(each, (SIDE, SIDE)) for each in shown]))
    cv2.imwrite(str(sheet), np.vstack(rows)[..., ::-1].astype(np.uint8))
    return "  ".join(said)


def make_worlds(asked: argparse.Namespace) -> None:
    """Once, for all runs."""
    photos = split_photos(pictures_below(asked.photos), "train")
    write_worlds(asked.folder / "worlds", WORLDS, photos)
    write_views(asked.folder / "views", VIEWS, photos)


def train(asked: argparse.Namespace) -> None:
    """Learn for asked.minutes, measured in asked.looks parts."""
    torch.manual_seed(asked.seed)
    crops, run = Crops(asked.folder, asked.photos), Run(asked.start)
    asked.output.mkdir(parents=True, exist_ok=True)
    state = asked.output / "state.pt"
    if asked.resume:
        run.load(state)
    rng = np.random.default_rng([asked.seed, run.step])
    print(f"step {run.step}: {measure(run, crops.held_out, asked.output / 'start.png')}", flush=True)
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


def mean(asked: argparse.Namespace) -> None:
    """The mean of two files' weights."""
    first, second = (Generator(file) for file in asked.files)
    for mine, other in zip(first.parameters(), second.parameters()):
        mine.data.lerp_(other.data, asked.share)
    first.write(asked.files[0], asked.output)


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
    four = verbs.add_parser("mean")
    four.add_argument("files", type=Path, nargs=2)
    four.add_argument("--share", type=float, default=0.5, help="of the second")
    four.add_argument("-o", "--output", type=Path, required=True)
    four.set_defaults(do=mean)
    asked = parser.parse_args()
    asked.do(asked)


if __name__ == "__main__":
    main()
