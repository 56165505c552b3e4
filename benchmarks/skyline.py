"""Pieces of walls near or across the skyline, marked and removed: nothing stands there, so the picture itself is the truth.

    python benchmarks/skyline.py ../shared --streets s06 s08 --worlds 700 760
    python benchmarks/skyline.py ../shared --across --without enclosed-sky between

Printed by domain: squared error and LPIPS in the mask, mean depth error (m, what is beyond 50 m and sky at 50 m), and the share
of the mask that is sky and should not be. Rectangles of .15 to .45 of the picture's sides, without sky in them and at most .08 of
its height below it; --across: a twentieth to .6 of each is sky. Four minutes on one core.
"""

from __future__ import annotations

import argparse
import warnings
import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.datasets.frames import ViewTruth
from dlama.datasets.layouts import open_dataset
from dlama.evaluation.metrics.lpips import distance_map, features
from dlama.geometry.holes import box_around
from dlama.geometry.rgbd import RGBD, BoolArray
from rules import RULES, without
from world_cases import world_case

SENSORS = "exact", "kinect", "matcher"
SIDES, SKY, NEAR, ACROSS, TRIED = (0.15, 0.45), (0.02, 0.8), 0.08, (0.05, 0.6), 400
FARTHEST_M, MARGIN = 50.0, 32


def frames(shared: Path, streets: Sequence[str], worlds: range) -> Iterator[tuple[str, str, RGBD, int]]:
    """Domain, name, frame, and how many rectangles are marked in it."""
    for case in open_dataset(shared / "street").of("vpi"):
        if case.scene in streets:
            truth = case.load()
            assert isinstance(truth, ViewTruth)
            yield "street", f"{case.scene}/{case.frame}", truth.source, 2
            yield "street", f"{case.scene}/{case.frame}t", truth.target, 2
    for number in worlds:
        yield "world", f"w{number}", world_case(number, "view", SENSORS[number % len(SENSORS)]).source, 1


def marked_pieces(frame: RGBD, name: str, across: bool) -> Iterator[BoolArray]:
    """H x W masks."""
    (height, width), rng = frame.far.shape, np.random.default_rng(zlib.crc32(name.encode()))
    if not SKY[0] < frame.far.mean() < SKY[1]:
        return
    distance = cv2.distanceTransform((~frame.far).astype(np.uint8), cv2.DIST_L2, 5)
    for _ in range(TRIED):
        high, wide = (int(rng.integers(int(SIDES[0] * side), int(SIDES[1] * side))) for side in (height, width))
        top, left = int(rng.integers(0, height - high)), int(rng.integers(0, width - wide))
        box = slice(top, top + high), slice(left, left + wide)
        fits = ACROSS[0] < frame.far[box].mean() < ACROSS[1]
        if not across:
            fits = 5 <= distance[box].min() <= NEAR * height
        if fits:
            mask = np.zeros(frame.far.shape, np.bool_)
            mask[box] = True
            yield mask


def measure(frame: RGBD, mask: BoolArray) -> list[float]:
    """Squared error, LPIPS, depth error and false sky in the mask (H x W) once it is removed."""
    view = dlama.remove(frame, mask).view
    box = box_around(mask, MARGIN)
    taps = [features(np.ascontiguousarray(one[box])) for one in (frame.color, view.color)]
    lpips = distance_map(*taps, mask[box].shape)[mask[box]].mean()
    off = np.abs(np.minimum(view.depth, FARTHEST_M) - np.minimum(frame.depth, FARTHEST_M))
    squared = ((view.color.astype(np.float64) - frame.color) ** 2).mean(2)
    false = view.far & ~frame.far
    return [
        float(squared[mask].mean()),
        float(lpips),
        float(off[mask & ~frame.missing].mean()),
        float(false[mask].mean()),
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path, help="folder of the shared data")
    parser.add_argument("--streets", nargs="*", default=["s06", "s08"])
    parser.add_argument("--worlds", nargs=2, type=int, default=(700, 760), metavar=("FIRST", "END"))
    parser.add_argument("--across", action="store_true", help="rectangles across the skyline")
    parser.add_argument("--without", nargs="*", choices=RULES, default=[], help="rules that are turned off")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    found: dict[str, list[list[float]]] = {}
    with ExitStack() as stack:
        for rule in args.without:
            stack.enter_context(without(rule))
        for domain, name, frame, count in frames(args.shared, args.streets, range(*args.worlds)):
            found.setdefault(domain, []).extend(
                measure(frame, mask) for mask in islice(marked_pieces(frame, name, args.across), count)
            )
    print("| domain | pieces | squared error | LPIPS | depth, m | false sky |\n|---|---|---|---|---|---|")
    for domain, rows in found.items():
        squared, lpips, depth, false = np.mean(rows, axis=0)
        print(f"| {domain} | {len(rows)} | {squared:.0f} | {lpips:.3f} | {depth:.2f} | {false:.1%} |")


if __name__ == "__main__":
    main()
