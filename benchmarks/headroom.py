"""How much better a view could be: where the error of filled pictures lies, and what no guess can avoid.

    python benchmarks/headroom.py ../shared/street

For every yaw, over the scenes, mean of + and -: the whole picture's squared colour error of `paper/telea` and of
`dlama/layered`, and of the latter the parts that come from known pixels, from dis-occlusions and from what is out of view.
Then what would be left if the pixels out of view were filled with the truth itself, but blurred to N x N cells: a guess that
knows the layout, brightness and tint of everything outside the picture and lacks only what is smaller than a cell.

Beside them, the parts of the squared error of depth as the paper shows it (clipped at 10 m, 8 bits).

The second table is what reading colours by cubic B-spline gives: LPIPS and squared error where the target was seen, the truth
pasted elsewhere, beside bilinear.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import cv2
import numpy as np

from dlama.completion.pipeline import complete
from dlama.datasets.frames import ViewTruth
from dlama.datasets.layouts import open_dataset
from dlama.evaluation.metrics.lpips import Lpips
from dlama.evaluation.metrics.pictures import depth_8bit
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.view import HoleType

YAWS = (10, 20, 30, 40, 50, 60)
CELLS = (8, 16, 32)
CLIP_M = 10.0

Rows = dict[str, dict[int, list[float]]]


def squared(mine: UInt8Array, truth: UInt8Array) -> np.ndarray:
    """H x W squared difference, mean over channels where there are any."""
    error = (mine.astype(float) - truth) ** 2
    return np.asarray(error.mean(-1) if error.ndim == 3 else error)


def blurred(truth: UInt8Array, cells: int) -> np.ndarray:
    """The truth as cells x cells means, enlarged again."""
    small = cv2.resize(truth.astype(np.float32), (cells, cells), interpolation=cv2.INTER_AREA)
    return cv2.resize(small, truth.shape[1::-1], interpolation=cv2.INTER_CUBIC)


def measure_fill(truth: ViewTruth, yaw: int, rows: Rows) -> None:
    """One case's squared errors by where they come from."""
    target = truth.target
    paper = complete(truth.source, [target.camera], recipe="paper", filler="telea").view
    done = complete(truth.source, [target.camera], filler="layered")
    hole, kind = done.warped[-1].hole, done.warped[-1].hole_type
    beyond = hole & (kind == HoleType.OUT_OF_VIEW)
    error = squared(done.view.color, target.color)
    rows["paper/telea"][yaw].append(squared(paper.color, target.color).mean())
    rows["dlama/layered"][yaw].append(error.mean())
    for name, where in (("known", ~hole), ("dis-occluded", hole & ~beyond), ("out of view", beyond)):
        rows[f"  of it {name}"][yaw].append((error * where).mean())
    for cells in CELLS:
        best = np.where(beyond, squared(blurred(target.color, cells), target.color), error)
        rows[f"truth at {cells}x{cells} beyond"][yaw].append(best.mean())
    depth_error = squared(depth_8bit(done.view.depth, CLIP_M), depth_8bit(target.depth, CLIP_M))
    for name, where in (
        ("all", hole | ~hole),
        ("known", ~hole),
        ("dis-occluded", hole & ~beyond),
        ("out of view", beyond),
    ):
        rows[f"depth, {name}"][yaw].append((depth_error * where).mean())


def measure_sampling(truth: ViewTruth, yaw: int, rows: Rows, lpips: Lpips) -> None:
    """One case's errors where it was seen, with either way of reading colours."""
    target = truth.target
    for fine in (False, True):
        view = render(truth.source, target.camera, types=False, fine=fine)
        name = "spline" if fine else "bilinear"
        rows[f"{name} LPIPS"][yaw].append(lpips.region(view.color, target.color, ~view.hole))
        rows[f"{name} MSE"][yaw].append(squared(view.color, target.color)[~view.hole].mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("street", type=Path)
    parser.add_argument("--scenes", nargs="*")
    asked = parser.parse_args()
    tables: list[Rows] = [defaultdict(lambda: defaultdict(list)) for _ in range(2)]
    lpips = Lpips()
    for case in open_dataset(asked.street, scenes=asked.scenes).of("vpi"):
        truth = case.load()
        assert isinstance(truth, ViewTruth) and case.yaw is not None
        yaw = abs(round(case.yaw))
        measure_fill(truth, yaw, tables[0])
        measure_sampling(truth, yaw, tables[1], lpips)
    print(f"{'':26}" + "".join(f"{'±' + str(yaw):>8}" for yaw in YAWS))
    for table in tables:
        for name, row in table.items():
            values = [float(np.mean(row[yaw])) for yaw in YAWS]
            print(f"{name:26}" + "".join(f"{value:8.3f}" if "LPIPS" in name else f"{value:8.0f}" for value in values))
        print()


if __name__ == "__main__":
    main()
