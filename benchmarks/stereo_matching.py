"""Stereo matching against true disparities, side by side with plain searches by OpenCV: prints one row for each pair and way.

python benchmarks/stereo_matching.py --data FOLDER

FOLDER holds `stereo` and `motorcycle` (Middlebury) and `street` (rendered), or some of them. Counted are pixels that both cameras
see: bad-1 (off by more than 1 px, or unknown), bad-0.5, the share that is known, the mean error of those (px), and for rendered
pairs `depth 5 %`, the share whose depth is off by more than 5 % or unknown, of what has at least half a pixel of disparity.
Seconds are of the processor, over all pairs.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from dlama.datasets.frames import StereoTruth
from dlama.datasets.layouts import open_dataset
from dlama.evaluation.metrics.disparity import visible_in_right
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.perception.stereo.matching import disparity_pair

Matcher = Callable[[UInt8Array, UInt8Array], Float32Array]
FOLDERS = ("stereo", "motorcycle", "data/stereo", "data/motorcycle", "street")
HEADS = ("bad-1", "bad-0.5", "known", "EPE", "depth 5 %")
FAR_PX = 0.5
RANGE_PX = 96
"""Of the plain searches; the range is known to hold every pair here."""


def ours(left: UInt8Array, right: UInt8Array) -> Float32Array:
    """The package's, which finds the range itself."""
    return disparity_pair(left, right)[0]


def plain(mode: int, scale: int, cap: int, unique: int) -> Matcher:
    """OpenCV's semi-global matching with a check of left against right, and no more: what the package had for its matching
    before is three paths at twice the width (scale 2)."""

    def one(base: UInt8Array, other: UInt8Array) -> Float32Array:
        count = 16 * math.ceil((RANGE_PX * scale + 4) / 16)
        found = cv2.StereoSGBM.create(-2, count, 3, 216, 864, -1, cap, unique, 0, 0, mode)
        pad = [cv2.copyMakeBorder(picture, 0, 0, count, 4, cv2.BORDER_REPLICATE) for picture in (base, other)]
        raw = found.compute(*pad)[:, count:-4].astype(np.float32) / 16
        return np.where(raw < -0.5, np.nan, np.maximum(raw, 0)).astype(np.float32)

    def match(left: UInt8Array, right: UInt8Array) -> Float32Array:
        size = left.shape[1] * scale, left.shape[0]
        left, right = (cv2.resize(picture, size, interpolation=cv2.INTER_CUBIC) for picture in (left, right))
        at_left, at_right = one(left, right), one(right[:, ::-1], left[:, ::-1])[:, ::-1]
        columns = np.clip(np.rint(np.arange(size[0]) - np.nan_to_num(at_left)), 0, size[0] - 1).astype(int)
        apart = np.abs(np.take_along_axis(at_right, columns, 1) - at_left)
        checked = np.where(apart <= scale, np.maximum(at_left, 1e-6), 0)
        return (checked[:, ::scale] / scale).astype(np.float32)

    return match


WAYS: dict[str, Matcher] = {
    "three paths, 2 x width": plain(cv2.STEREO_SGBM_MODE_SGBM_3WAY, 2, 31, 5),
    "three paths": plain(cv2.STEREO_SGBM_MODE_SGBM_3WAY, 1, 31, 5),
    "eight paths": plain(cv2.STEREO_SGBM_MODE_HH, 1, 31, 5),
    "eight paths, cap 15": plain(cv2.STEREO_SGBM_MODE_HH, 1, 15, 0),
    "dlama": ours,
}


def pairs(root: Path) -> dict[str, StereoTruth]:
    """Every pair under the folders of `root` that are there; of street the dev scenes, with the object in."""
    found = {}
    for name in FOLDERS:
        if (root / name).is_dir():
            scenes = ["s03", "s05"] if name == "street" else None
            for case in open_dataset(root / name, scenes=scenes).cases:
                truth = case.load() if case.protocol == "sii" else None
                if isinstance(truth, StereoTruth):
                    found[f"{case.scene}/{case.frame}"] = truth
    return found


def scores(found: Float32Array, truth: StereoTruth) -> list[float]:
    """As HEADS; NaN where a pair cannot say."""
    # the sky of a rendered pair has no disparity, and every camera sees it
    sky = truth.mask_left is not None and truth.disparity_left == 0
    true = np.where(sky, np.float32(1e-3), np.where(np.isfinite(truth.disparity_left), truth.disparity_left, 0))
    seen = visible_in_right(true)
    known = found[seen] != 0
    error = np.where(known, np.abs(found[seen] - true[seen]), np.inf)
    near = true[seen] >= FAR_PX
    depth = float((error > 0.05 * true[seen])[near].mean()) if truth.mask_left is not None else math.nan
    return [
        float((error > 1).mean()),
        float((error > 0.5).mean()),
        float(known.mean()),
        float(error[known].mean()),
        depth,
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    asked = pairs(parser.parse_args().data)
    if not asked:
        parser.error(f"no stereo pairs with true disparity; folders {', '.join(FOLDERS)} are looked for")
    print(f"{'':<50}" + "".join(f"{head:>10}" for head in HEADS) + f"{'CPU s':>8}")
    for way, match in WAYS.items():
        table, began = [], time.process_time()
        for truth in asked.values():
            table.append(scores(match(truth.left, truth.right), truth))
        took = time.process_time() - began
        for name, row in [*zip(asked, table), ("mean", list(np.nanmean(table, 0)))]:
            cells = "".join(f"{value:>10.4f}" if value == value else f"{'':>10}" for value in row)
            print(f"{way:<24}{name:<26}{cells}" + (f"{took:>8.1f}" if name == "mean" else ""))


if __name__ == "__main__":
    main()
