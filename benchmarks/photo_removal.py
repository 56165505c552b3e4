"""Objects removed from single photos without depth, filler next to filler; prints a table, writes a sheet of pictures.

    python benchmarks/photo_removal.py ../shared
    python benchmarks/photo_removal.py ../shared --photos 0 --sheet docs/images/photo-removal.jpg

Truth: the street's pictures without their object, the bin without its objects, and photos that lose the shape of the object that
stands out of another photo: what it hides is known. Measured over what was filled, the truth pasted outside it. The seed draws
the photos; the shadow of a removed object stays in `street`, for all alike.
"""

from __future__ import annotations

import argparse
import itertools
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.datasets.frames import RemovalTruth
from dlama.datasets.layouts import open_dataset
from dlama.evaluation.metrics.lpips import lpips
from dlama.files.rasters.pictures import read_color
from dlama.geometry.codes import Origin
from dlama.geometry.rgbd import BoolArray, UInt8Array

FILLERS = ("telea", "layered", "migan", "patchmatch")
SHARES = (0.04, 0.35)
"""Of a picture, that the shape of an object may take."""
SIDE = 216
"""Width of the sheet's pictures in pixels."""
Score = tuple[float, float, float]
"""Squared error of the colours, LPIPS, seconds of processor time."""


@dataclass(frozen=True)
class Removal:
    """A photo, what is to go, and what is behind it."""

    kind: str
    color: UInt8Array
    mask: BoolArray
    truth: UInt8Array


def pictures(folder: Path) -> Iterator[Removal]:
    """The street's four objects, from where their orbits begin, and the bin's objects."""
    for kind, where in {"street": folder / "street", "bin": folder / "data" / "bin_removal"}.items():
        for _, of_scene in itertools.groupby(open_dataset(where).of("ori"), lambda case: case.scene):
            found = next(of_scene).load()
            assert isinstance(found, RemovalTruth)
            yield Removal(kind, found.source.color, found.mask, found.without.color)


def photos(folder: Path, count: int, seed: int) -> Iterator[Removal]:
    """Photos that lose the shape of another's object: `count` of imagenet, a third as many of urban100, a quarter of camvid."""
    rng = np.random.default_rng(seed)
    drawn = in_any_order(folder / "photos" / "imagenet", rng)
    shapes = [shape for file in drawn[count : 5 * count] if (shape := shape_of_object(file)) is not None]
    sets = {"imagenet": drawn[:count]}
    for name, share in (("urban100", 3), ("camvid", 4)):
        sets[name] = in_any_order(folder / "photos" / name, rng)[: count // share]
    for name, files in sets.items():
        for number, file in enumerate(files):
            color = read_color(file)
            yield Removal(name, color, in_the_middle(shapes[number % len(shapes)], color.shape[:2]), color)


def in_any_order(folder: Path, rng: np.random.Generator) -> list[Path]:
    """Its pictures."""
    files = sorted(folder.glob("*.[jp][pn]g"))
    return [files[i] for i in rng.permutation(len(files))]


def shape_of_object(file: Path) -> BoolArray | None:
    """What stands out of a photo; None where nothing does, or too little or too much."""
    try:
        shape = dlama.find_mask(read_color(file), masker="salient").mask
    except dlama.DlamaError:
        return None
    return shape if SHARES[0] < shape.mean() < SHARES[1] else None


def in_the_middle(shape: BoolArray, hw: tuple[int, ...]) -> BoolArray:
    """The shape in a picture of that height and width, as large as fits."""
    side = min(hw)
    top, left = (hw[0] - side) // 2, (hw[1] - side) // 2
    out = np.zeros(hw, np.bool_)
    large = cv2.resize(shape.astype(np.uint8), (side, side), interpolation=cv2.INTER_NEAREST)
    out[top : top + side, left : left + side] = large > 0
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="with street, data and photos in it")
    parser.add_argument("--photos", type=int, default=24, help="how many of imagenet")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--fillers", nargs="+", default=FILLERS)
    parser.add_argument("--sheet", type=Path, help="a picture of all cases: known, each filler, truth")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    rows = []
    scores: dict[tuple[str, str], list[Score]] = {}
    for case in [*pictures(options.folder), *photos(options.folder, options.photos, options.seed)]:
        rgbd, shown = dlama.estimate_depth(case.color).rgbd, []
        for filler in options.fillers:
            started = time.process_time()
            done = dlama.remove(rgbd, case.mask, filler=filler).view
            spent, hole = time.process_time() - started, done.origin == Origin.FILLED
            pasted = np.where(hole[..., None], done.color, case.truth)
            squared = float(((pasted.astype(float) - case.truth) ** 2)[hole].mean())
            scores.setdefault((case.kind, filler), []).append((squared, lpips(pasted, case.truth, hole), spent))
            shown.append(done.color)
        known = np.where(hole[..., None], np.uint8([255, 0, 255]), rgbd.color)
        rows.append([known, *shown, case.truth])
    print_table(scores, options.fillers)
    if options.sheet:
        write_sheet(rows, options.sheet)


def print_table(scores: dict[tuple[str, str], list[Score]], fillers: Sequence[str]) -> None:
    """One row a filler: squared error and LPIPS of each kind, their means over all cases, seconds of processor time each."""
    kinds = list(dict.fromkeys(kind for kind, _ in scores))
    print("| filler | " + " | ".join(f"{kind} MSE, LPIPS" for kind in kinds) + " | all MSE, LPIPS | s |")
    print("|---" * (len(kinds) + 3) + "|")
    for filler in fillers:
        groups = [scores[kind, filler] for kind in kinds]
        groups.append([one for group in groups for one in group])
        cells = [f"{np.mean([s[0] for s in group]):.0f}, {np.mean([s[1] for s in group]):.3f}" for group in groups]
        print(f"| {filler} | " + " | ".join(cells) + f" | {np.mean([s[2] for s in groups[-1]]):.2f} |")


def write_sheet(rows: list[list[UInt8Array]], file: Path) -> None:
    """All cases below each other, each picture SIDE pixels wide."""
    lines = []
    for row in rows:
        size = SIDE, SIDE * row[0].shape[0] // row[0].shape[1]
        lines.append(np.concatenate([cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in row], 1))
    cv2.imwrite(str(file), np.concatenate(lines)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
