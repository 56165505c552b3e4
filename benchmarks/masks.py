"""Data sets with true object masks in; how well `find_mask` finds them out, beside OpenCV's GrabCut alone, as a table.

    python benchmarks/masks.py worlds:100 FOLDER/street FOLDER/bin_removal [--every N] [--no-grabcut] [--removal]

One click at the true mask's innermost pixel, then up to three corrections, each at the innermost pixel of the largest wrong
region; a box: that of the true mask, 5 % larger. GrabCut gets the same box, and a quarter of the picture round the first click.
IoU, and F of borders within 2 px (Martin et al. 2004). With --removal: errors of `dlama.remove` in the true mask's region with
the found mask (one click) over those with the true one. Processor time is of `find_mask` for one click, the first call left out.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.datasets.frames import RemovalTruth
from dlama.geometry.holes import dilated, eroded
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.worlds.dataset import open_dataset_or_worlds

CLICKS = 4
BORDER_PX = 2
SMALLEST_PX = 50

Box = tuple[float, float, float, float]


def innermost(where: BoolArray) -> tuple[int, int]:
    """x, y of the pixel farthest from where `where` ends."""
    distance = cv2.distanceTransform(np.pad(where.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    row, column = np.unravel_index(int(distance.argmax()), distance.shape)
    return int(column), int(row)


def largest_region(where: BoolArray) -> BoolArray:
    """The largest 8-connected region."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(where.astype(np.uint8), connectivity=8)
    return np.asarray(labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()))


def box_of(mask: BoolArray, larger: float = 0.05) -> Box:
    """x, y, width, height of the mask's box, so much larger."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    high, wide = float(np.ptp(rows) + 1), float(np.ptp(columns) + 1)
    return columns[0] - larger / 2 * wide, rows[0] - larger / 2 * high, (1 + larger) * wide, (1 + larger) * high


def iou(found: BoolArray, true: BoolArray) -> float:
    return float((found & true).sum() / max((found | true).sum(), 1))


def border_f(found: BoolArray, true: BoolArray) -> float:
    """Harmonic mean of the shares of each border that lie within BORDER_PX of the other."""
    one, other = (mask & ~eroded(mask, 1) for mask in (found, true))
    if not one.any() or not other.any():
        return 0.0
    precise, complete = (
        (one & dilated(other, BORDER_PX)).sum() / one.sum(),
        (other & dilated(one, BORDER_PX)).sum() / other.sum(),
    )
    return float(2 * precise * complete / max(precise + complete, 1e-9))


def grabcut(color: UInt8Array, box: Box) -> BoolArray:
    """OpenCV's GrabCut alone, five rounds from a box, clipped to the picture."""
    height, width = color.shape[:2]
    x, y = max(0, round(box[0])), max(0, round(box[1]))
    clipped = (x, y, max(1, min(width, round(box[0] + box[2])) - x), max(1, min(height, round(box[1] + box[3])) - y))
    state = np.zeros((height, width), np.uint8)
    cv2.setRNGSeed(0)
    cv2.grabCut(
        np.ascontiguousarray(color), state, clipped, np.zeros((1, 65)), np.zeros((1, 65)), 5, cv2.GC_INIT_WITH_RECT
    )
    return np.asarray((state == cv2.GC_FGD) | (state == cv2.GC_PR_FGD))


def found_or_nothing(rgbd: RGBD, **prompt: object) -> BoolArray:
    try:
        return dlama.find_mask(rgbd, **prompt).mask  # type: ignore[arg-type]
    except dlama.MaskError:
        return np.zeros(rgbd.depth.shape, np.bool_)


def clicked(rgbd: RGBD, true: BoolArray) -> list[BoolArray]:
    """The masks after one click, and after each correction."""
    clicks, away = [innermost(true)], []
    masks: list[BoolArray] = []
    while len(masks) < CLICKS:
        masks.append(found_or_nothing(rgbd, clicks=clicks, not_clicks=away))
        wrong = masks[-1] ^ true
        if not wrong.any():
            return masks + [masks[-1]] * (CLICKS - len(masks))
        x, y = innermost(largest_region(wrong))
        (clicks if true[y, x] else away).append((x, y))
    return masks


def removal_errors(truth: RemovalTruth, mask: BoolArray) -> tuple[float, float]:
    """Mean squared colour error and mean depth error (m, cut at 10 m) in the true mask's region after the removal."""
    if not mask.any():
        return float("nan"), float("nan")
    view = dlama.remove(truth.source, mask).view
    there = truth.mask & (truth.compare if truth.compare is not None else True)
    color = ((view.color.astype(float) - truth.without.color) ** 2).mean(2)[there].mean()
    mine, true = (np.minimum(np.where(d > 0, d, np.nan), 10) for d in (view.depth, truth.without.depth))
    return float(color), float(np.nanmean(np.abs(mine - true)[there]))


def measured(truth: RemovalTruth, with_grabcut: bool, with_removal: bool) -> dict[str, tuple[float, float]]:
    """Row -> (IoU, F of borders); of removals the two errors."""
    rgbd, true = truth.source, truth.mask
    started = time.process_time()
    first = found_or_nothing(rgbd, clicks=[innermost(true)])
    rows = {"seconds of processor, one click": (time.process_time() - started, 0.0)}
    names = ["one click", "2 clicks", "3 clicks", "4 clicks"]
    masks = dict(zip(names, clicked(rgbd, true))) | {"box": found_or_nothing(rgbd, box=box_of(true))}
    if with_grabcut:
        (x, y), (height, width) = innermost(true), true.shape
        masks["GrabCut, box"] = grabcut(rgbd.color, box_of(true))
        masks["GrabCut, click"] = grabcut(rgbd.color, (x - width / 4, y - height / 4, width / 2, height / 2))
    rows |= {name: (iou(mask, true), border_f(mask, true)) for name, mask in masks.items()}
    if with_removal:
        rows["removal, found mask"], rows["removal, true mask"] = (removal_errors(truth, m) for m in (first, true))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="+", help="folders of data sets, or worlds:N")
    parser.add_argument("--every", type=int, default=1, help="take every Nth case")
    parser.add_argument("--scenes", nargs="*", help="only these scenes")
    parser.add_argument("--no-grabcut", action="store_true")
    parser.add_argument("--removal", action="store_true")
    given = parser.parse_args()
    for name in given.data:
        cases = open_dataset_or_worlds(name if name.startswith("worlds") else Path(name)).of("ori")
        if name.startswith("worlds"):
            cases = tuple(case for case in cases if case.yaw == 0)
        cases = tuple(case for case in cases if not given.scenes or case.scene in given.scenes)
        table: dict[str, list[tuple[float, float]]] = defaultdict(list)
        for case in cases[:: given.every]:
            truth = case.load()
            assert isinstance(truth, RemovalTruth)
            if truth.mask.sum() >= SMALLEST_PX:
                for row, values in measured(truth, not given.no_grabcut, given.removal).items():
                    table[row].append(values)
        print(f"{name}: {len(next(iter(table.values())))} cases\n{'':34} {'IoU':>8} {'border F':>9} {'worst IoU':>10}")
        for row, numbers in table.items():
            first, second = np.nanmean(np.array(numbers), axis=0)
            print(f"{row:34} {first:8.3f} {second:9.3f} {np.nanmin(np.array(numbers)[:, 0]):10.3f}", flush=True)


if __name__ == "__main__":
    main()
