"""MI-GAN's generator tuned on the holes that removals and views leave: packs of photos, worlds and views (`painter_crops`) in,
the network's file out.

    python benchmarks/painter.py pack FOLDER --photos ../shared/photos
    python benchmarks/painter.py train FOLDER --start FILE -o RUN --minutes 60 [--resume] [--device cuda --batch 32] [--guided]
    python benchmarks/painter.py export RUN --start FILE -o FILE [--guided]
    python benchmarks/painter.py mean FILE FILE --share 0.33 -o src/dlama/assets/migan/migan-512-tuned.onnx

`pack` takes an hour on two cores. Its files, none above 60 MB, are all that `train` reads, on a computer with a GPU or here.
`train` begins at the generator of --start (a file of `migan_export`) and keeps its structure; what is exported is the running
mean of its weights. It is measured on held-out photos, worlds and views: mean squared error in levels and LPIPS in the hole; some
of them are written as pictures. --guided: the network also sees what is known of the hole, the colours of the surfaces that
continue, their depth and the kind of hole. `mean` is that of two files' weights.

The file that ships was tuned on two cores, at an earlier state of these files: the mean of a run of 1,950 steps of four crops of
photos and worlds (2/3), and of the 1,440 steps that went on from it with views and depth (1/3). The second is better in views,
the first behind removed objects.
"""

from __future__ import annotations

import argparse
import math
import time
from functools import partial
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from dlama.datasets.text_tables import pictures_below
from dlama.training.data.photos import split_photos
from dlama.training.losses.perceptual import LpipsLoss
from dlama.writing.atomic_write import new_file
from painter_crops import (
    FIRST_HELD_OUT,
    FIRST_WORLD,
    hole_of_photo,
    in_parallel,
    outlines_of,
    view_crop,
    world_crop,
    write_pack,
)
from painter_data import LARGE_SIDE, SIDE, Batch, Crops
from painter_network import Generator, Run, Weights


class Counts(NamedTuple):
    """What a split has."""

    outlines: int
    """Photos whose objects' outlines are searched."""
    holes: int
    large_holes: int
    worlds: int
    views: int
    """Of each file."""
    view_files: int = 1


COUNTS = {"train": Counts(800, 7000, 3000, 400, 1250, 2), "held_out": Counts(200, 96, 48, 32, 100)}
WARMING, CONSTANT, LAST_RATE = 200, 0.5, 0.03
"""Steps in which the rate rises, the part of a run in which it is constant, and what a cosine leaves of it at the end."""
KINDS, AT_ONCE, SHOWN, LOGGED_EVERY = ("photos", "large photos", "worlds", "views"), 8, 12, 20


def pack(asked: argparse.Namespace) -> None:
    """Once, for all runs; files that are there stay."""
    asked.folder.mkdir(parents=True, exist_ok=True)
    found = pictures_below(asked.photos)
    textures = split_photos(found, "train")
    for split, first in (("train", FIRST_WORLD), ("held_out", FIRST_HELD_OUT)):
        pack_split(asked.folder / split, split_photos(found, split), textures, first)


def pack_split(folder: Path, photos: tuple[Path, ...], textures: tuple[Path, ...], first: int) -> None:
    """The packs of one split. textures: of worlds, whose numbers begin at `first`."""
    folder.mkdir(exist_ok=True)
    counts = COUNTS[folder.name]
    if not (path := folder / "photos.npz").exists():
        write_pack(path, ({"photo": photo.read_bytes()} for photo in photos))
    if not (path := folder / "holes.npz").exists():
        write_holes(path, photos, counts)
    if not (path := folder / "worlds.npz").exists():
        crop = partial(world_crop, photos=textures, first=first)
        write_pack(path, in_parallel(crop, range(counts.worlds)))
    for number in range(counts.view_files):
        if not (path := folder / f"views{number}.npz").exists():
            crop = partial(view_crop, photos=photos, textures=textures, first=first)
            write_pack(path, in_parallel(crop, range(number * counts.views, (number + 1) * counts.views)))


def write_holes(path: Path, photos: tuple[Path, ...], counts: Counts) -> None:
    """Holes of photos, of each size, packed to bits along their rows."""
    rng = np.random.default_rng(len(photos))
    outlines = outlines_of([photos[place] for place in rng.permutation(len(photos))[: counts.outlines]])
    holes = {
        str(side): np.packbits(np.stack([hole_of_photo(outlines, side, rng) for _ in range(count)]), axis=2)
        for side, count in ((SIDE, counts.holes), (LARGE_SIDE, counts.large_holes))
    }
    with new_file(path) as draft, draft.open("wb") as stream:
        np.savez_compressed(stream, **holes)


@torch.no_grad()
def measure(run: Run, held_out: Crops, sheets: Path | None = None) -> str:
    """LPIPS and mean squared error in levels of each kind of crops; and pictures of known, filled and true ones."""
    said = []
    for kind in KINDS:
        values = []
        for batch in held_out.whole(kind, AT_ONCE):
            filled = run.averaged.fill(batch).clamp(0, 1)
            filled = torch.where(batch.counted > 0, filled, batch.truth)
            if sheets is not None and not values:
                write_sheet(sheets.with_name(f"{sheets.name}-{kind.replace(' ', '-')}.jpg"), batch, filled)
            values.append(torch.stack([lpips_in(run.perceptual, filled, batch), squared_in(filled, batch)], 1))
        lpips, squared = torch.cat(values).mean(0).tolist()
        said.append(f"{kind} {lpips:.4f} {squared:.1f}")
    return "  ".join(said)


def squared_in(filled: Tensor, batch: Batch) -> Tensor:
    """B: mean squared error in the counted pixels, in levels."""
    off = (255 * (filled - batch.truth)).square().mean(1, keepdim=True) * batch.counted
    return off.sum((1, 2, 3)) / batch.counted.sum((1, 2, 3)).clamp_min(1)


def lpips_in(network: LpipsLoss, filled: Tensor, batch: Batch) -> Tensor:
    """B: LPIPS in the counted pixels."""
    distance = torch.zeros_like(batch.counted)
    for mine, true in zip(network.taps(filled), network.taps(batch.truth)):
        layer = (mine - true).square().sum(1, keepdim=True)
        distance += functional.interpolate(layer, distance.shape[2:], mode="bilinear")
    return (distance * batch.counted).sum((1, 2, 3)) / batch.counted.sum((1, 2, 3)).clamp_min(1)


def write_sheet(path: Path, batch: Batch, filled: Tensor) -> None:
    """What is known, filled and true of the first crops."""
    shown = torch.cat([batch.color * (1 - batch.hole), filled, batch.truth], 3)[:SHOWN]
    picture = torch.cat(list(shown), 1).mul(255).round().byte().permute(1, 2, 0).cpu().numpy()
    cv2.imwrite(str(path), np.ascontiguousarray(picture[..., ::-1]))


def train(asked: argparse.Namespace) -> None:
    """Learn for asked.minutes, measured asked.looks times."""
    torch.manual_seed(asked.seed)
    device, weights = torch.device(asked.device), Weights(**dict(asked.weight))
    learnt, held_out = (Crops(asked.folder / split, device) for split in COUNTS)
    run = Run(asked.start, device, weights, asked.guided, asked.half or device.type == "cuda")
    asked.output.mkdir(parents=True, exist_ok=True)
    state = asked.output / "state.pt"
    if asked.resume:
        run.load(state)
    rng = np.random.default_rng([asked.seed, run.step])
    print(f"step {run.step}: {measure(run, held_out, asked.output / 'start')}", flush=True)
    started, first, losses, look = time.monotonic(), run.step, [], 1
    while (done := (time.monotonic() - started) / (60 * asked.minutes)) < 1:
        falling = max(0.0, (done - CONSTANT) / (1 - CONSTANT))
        rate = LAST_RATE + (1 - LAST_RATE) * (1 + math.cos(math.pi * falling)) / 2
        run.set_rate(rate * min(1, (1 + run.step - first) / WARMING))
        loss = run.learn(learnt.draw(asked.batch, rng), rng)
        if run.step % LOGGED_EVERY == 0:
            losses.append(loss.cpu().numpy())
        if done > look / asked.looks:
            run.save(state)
            mean_loss = np.mean(losses, 0).round(4) if losses else ""
            print(f"step {run.step}: {mean_loss} {measure(run, held_out)}", flush=True)
            losses, look = [], look + 1
    run.save(state)
    print(f"step {run.step}: {measure(run, held_out, asked.output / f'{run.step:06}')}", flush=True)


def export(asked: argparse.Namespace) -> None:
    """The running mean as a file like that of --start."""
    run = Run(asked.start, torch.device("cpu"), Weights(), asked.guided)
    run.load(asked.run / "state.pt")
    run.averaged.write(asked.start, asked.output)


def mean(asked: argparse.Namespace) -> None:
    """The mean of two files' weights."""
    first, second = (Generator(file) for file in asked.files)
    for mine, other in zip(first.parameters(), second.parameters()):
        mine.data.lerp_(other.data, asked.share)
    first.write(asked.files[0], asked.output)


def weight(text: str) -> tuple[str, float]:
    """NAME=VALUE, of `Weights`."""
    name, _, value = text.partition("=")
    if name not in Weights._fields:
        raise argparse.ArgumentTypeError(f"{text!r}: NAME=VALUE is expected, NAME of {', '.join(Weights._fields)}")
    return name, float(value)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True)
    one = verbs.add_parser("pack")
    one.add_argument("folder", type=Path)
    one.add_argument("--photos", type=Path, required=True)
    one.set_defaults(do=pack)
    two = verbs.add_parser("train")
    two.add_argument("folder", type=Path, help="of packs")
    two.add_argument("--start", type=Path, required=True)
    two.add_argument("-o", "--output", type=Path, required=True)
    two.add_argument("--minutes", type=float, default=60)
    two.add_argument("--looks", type=int, default=6)
    two.add_argument("--batch", type=int, default=4, help="small crops of a step")
    two.add_argument("--device", default="cpu")
    two.add_argument("--weight", type=weight, nargs="*", default=[], help="NAME=VALUE of a term of the loss")
    two.add_argument("--guided", action="store_true")
    two.add_argument("--half", action="store_true", help="bfloat16, as always on a GPU; for processors with AMX")
    two.add_argument("--seed", type=int, default=0)
    two.add_argument("--resume", action="store_true")
    two.set_defaults(do=train)
    three = verbs.add_parser("export")
    three.add_argument("run", type=Path)
    three.add_argument("--start", type=Path, required=True)
    three.add_argument("-o", "--output", type=Path, required=True)
    three.add_argument("--guided", action="store_true")
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
