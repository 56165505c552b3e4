"""Depth that one posed frame lacks, completed from its neighbours and its own colours, against what was there: with and without a
rule.

    python benchmarks/frames_depth.py ../shared/data/kitchen_sequence --apart 6 --every 7 [--rule unlike-frames]
    python benchmarks/frames_depth.py worlds --first 800 --last 812

Of a data set: depth is erased along the border of each frame, as a depth camera misses it, and in four squares; what was measured
there is the truth. Worlds are seen by a Kinect, 12 degrees apart, and what it misses counts. Printed: mean error of the logarithm
of depth (1 at most), share of it above a tenth, and share taken from other frames; then the change of the first with its 95 %
interval.
"""

from __future__ import annotations

import argparse
import dataclasses
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import dlama
from dlama.datasets.sequences.loading import open_frames
from dlama.geometry.codes import Origin
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.worlds.dataset import world
from rules import RULES, without
from world_cases import as_seen

BORDER, SQUARES, SIDE = 0.11, 4, 0.2
"""Share of the height along the border, number of squares, and their sides as shares of the picture's."""
ASIDE_DEG = 12
Case = tuple[list[RGBD], Float32Array, BoolArray]
"""Frames, the first of which is completed; its true depth, H x W metres; where it counts, H x W."""


def of_data(folder: Path, apart: int, every: int) -> Iterator[Case]:
    """Frames of a data set, each with the two so many places away."""
    frames, rng = open_frames(folder), np.random.default_rng(0)
    for place in range(apart, len(frames) - apart, every):
        frame = frames[place].load()
        erased = np.zeros(frame.depth.shape, np.bool_)
        height, width = erased.shape
        rim = round(BORDER * height)
        erased[:rim] = erased[-rim:] = erased[:, :rim] = erased[:, -rim:] = True
        for _ in range(SQUARES):
            row, column = (rng.integers(0, round((1 - SIDE) * size)) for size in (height, width))
            erased[row : row + round(SIDE * height), column : column + round(SIDE * width)] = True
        erased &= frame.valid
        bare = dataclasses.replace(frame, depth=np.where(erased, np.float32(0), frame.depth))
        yield [bare, *(frames[place + by].load() for by in (-apart, apart))], frame.depth, erased


def of_worlds(first: int, last: int) -> Iterator[Case]:
    """Procedural worlds by a Kinect."""
    for number in range(first, last):
        scene, rng = world(number), np.random.default_rng(number)
        camera = scene.rig(320).left
        depth = scene.frame(camera).depth
        pivot = float(np.median(depth[np.isfinite(depth)]))
        cameras = [camera, *(dlama.orbit(camera, yaw, pivot=pivot) for yaw in (-ASIDE_DEG, ASIDE_DEG))]
        frames = [as_seen(scene.frame(each), "kinect", rng) for each in cameras]
        yield frames, depth, (frames[0].depth == 0) & np.isfinite(depth)


def measure(case: Case) -> tuple[float, float, float]:
    """Error, share of large errors, and share from other frames."""
    frames, depth, where = case
    view = dlama.complete(dlama.scene(frames), [frames[0].camera]).view
    error = np.minimum(np.abs(np.log(view.depth[where] / depth[where])), 1)
    return float(error.mean()), float((error > 0.1).mean()), float((view.origin[where] == Origin.ELSEWHERE).mean())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    for name, value in (("apart", 6), ("every", 1), ("first", 800), ("last", 812)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--rule", choices=RULES, default="unlike-frames")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    by_world = asked.folder == "worlds"
    cases = of_worlds(asked.first, asked.last) if by_world else of_data(Path(asked.folder), asked.apart, asked.every)
    rows: dict[str, list[tuple[float, float, float]]] = {asked.rule: [], "": []}
    for case in cases:
        for rule, values in rows.items():
            with without(rule):
                values.append(measure(case))
    before, now = (np.array(values) for values in rows.values())
    for name, values in ((f"without {asked.rule}", before), ("now", now)):
        print(f"{name:24} {len(values)} frames: " + " ".join(f"{value:.4f}" for value in values.mean(0)))
    drawn = np.random.default_rng(0).integers(0, len(now), (2000, len(now)))
    low, high = np.quantile(now[drawn, 0].mean(1) / before[drawn, 0].mean(1) - 1, (0.025, 0.975))
    print(f"change of the error {now[:, 0].mean() / before[:, 0].mean() - 1:+.1%} ({low:+.1%} to {high:+.1%})")


if __name__ == "__main__":
    main()
