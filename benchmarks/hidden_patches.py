"""Parts of real pictures hidden as if an object stood there, and filled: the picture is the truth.

    python benchmarks/hidden_patches.py ../shared/data/kitchen_sequence [--fillers layered migan ...] [--every 1] [-o sheets]

Masks are shapes of objects that a click found in the same frames, laid where 93 % of what they cover, and 85 % of what lies round
them, is one plane of the measured depth: a table, a wall, a cabinet's front. Two a frame, drawn with a fixed seed. Squared error
and LPIPS are taken over the shape grown by 6 px, as `dlama remove` grows it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.evaluation.metrics.lpips import lpips
from dlama.files.rasters.pictures import write_color
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.masks.supports import find_planes_of_picture

CLICKS = (
    (90, 473, 208), (400, 229, 205), (400, 321, 293), (220, 282, 367), (280, 342, 402), (330, 392, 240), (250, 229, 330),
    (300, 504, 315), (430, 209, 396),
)  # fmt: skip
"""Frame, x and y of the objects whose shapes are used; the first, a chair, is used in one of seven."""
LENS = {"fx": 526.0, "fy": 526.0, "cx": 320.5, "cy": 237.5, "pixel_center": 0.5}
A_FRAME, TRIES, SEED = 2, 400, 3
WITHIN, ROUND, GROWN_PX, MARGIN_PX = 0.93, 0.85, 6, 20


def frame(folder: Path, number: int) -> RGBD:
    name = f"frame-{number:06d}"
    return dlama.read_rgbd(folder / f"images/{name}.jpg", folder / f"depth/{name}.png", **LENS)  # type: ignore[arg-type]


def shapes_of_objects(folder: Path) -> list[BoolArray]:
    """The masks of CLICKS, each cut to its box."""
    out = []
    for number, x, y in CLICKS:
        mask = dlama.find_mask(frame(folder, number), clicks=[(x, y)]).mask
        rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
        out.append(mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])
    return out


def hidden(rgbd: RGBD, shapes: list[BoolArray], rng: np.random.Generator) -> Iterator[BoolArray]:
    """Up to A_FRAME masks, H x W, on one plane each."""
    label, found = find_planes_of_picture(rgbd).label, 0
    for _ in range(TRIES):
        shape = shapes[int(rng.integers(1, len(shapes))) if rng.random() < 0.85 else 0]
        shape = shape[:, ::-1] if rng.random() < 0.5 else shape
        (height, width), (rows, columns) = shape.shape, label.shape
        y, x = int(rng.integers(0, rows - height)), int(rng.integers(0, columns - width))
        mask = np.zeros(label.shape, np.bool_)
        mask[y : y + height, x : x + width] = shape
        most = int(np.bincount(label[mask].clip(0)).argmax())
        if (
            most
            and (label[mask] == most).mean() > WITHIN
            and (label[dilate_mask(mask, GROWN_PX)] == most).mean() > ROUND
        ):
            yield mask
            found += 1
            if found == A_FRAME:
                return


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fillers", nargs="+", default=["layered", "layered-patches", "migan"])
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, help="folder for the pictures: truth, then each filler's")
    given = parser.parse_args()
    rng, shapes = np.random.default_rng(SEED), shapes_of_objects(given.folder)
    rows: dict[str, list[tuple[float, float, float]]] = {filler: [] for filler in given.fillers}
    number = -1
    for index in range(len(list(given.folder.glob("images/*.jpg")))):
        rgbd = frame(given.folder, 10 * index)
        for mask in hidden(rgbd, shapes, rng):
            number += 1
            if number % given.every:
                continue
            region = dilate_mask(mask, GROWN_PX)
            x, y, width, height = cv2.boundingRect(region.astype(np.uint8))
            top, left = max(0, y - MARGIN_PX), max(0, x - MARGIN_PX)
            box = np.s_[top : y + height + MARGIN_PX, left : x + width + MARGIN_PX]
            strip = [rgbd.color[box]]
            for filler in given.fillers:
                before = time.process_time()
                color = dlama.remove(rgbd, mask, filler=filler).view.color
                seconds = time.process_time() - before
                off = color[region].astype(float) - rgbd.color[region]
                error = lpips(color[box], rgbd.color[box], region[box])
                rows[filler].append((float((off**2).mean()), error, seconds))
                strip.append(color[box])
            if given.output:
                given.output.mkdir(parents=True, exist_ok=True)
                write_color(given.output / f"{number:03d}.png", np.concatenate(strip, 1))
    print("| filler | places | squared error, mean | median | LPIPS | s of processor time |\n|---|---|---|---|---|---|")
    for filler, each in rows.items():
        error, distance, seconds = np.array(each).T
        means = f"{error.mean():.0f} | {np.median(error):.0f} | {distance.mean():.3f} | {seconds.mean():.1f}"
        print(f"| {filler} | {len(each)} | {means} |")


if __name__ == "__main__":
    main()
