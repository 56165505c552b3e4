"""Depth smaller than its picture, brought to its size: how far it is from the depth that it was shrunk from.

    python benchmarks/resized_depth.py ../shared --split validate --by 4 8

Of each frame of the suite (`bench.py`) that has measured depth the middle one of every N x N readings is kept. Printed, by
domain: mean error of the logarithm of depth and share of pixels off by more than 5 %, of the nearest pixel and of
`upsample_depth`.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

from bench import cases_of
from dlama.errors import InputError
from dlama.geometry.rgbd import RGBD, Float32Array, is_valid
from dlama.perception.resampling import nearest_pixels, upsample_depth

WAYS = {
    "nearest": lambda small, frame: nearest_pixels(small, frame.depth.shape),
    "guided": lambda small, frame: upsample_depth(small, frame.color),
}
WRONG, MOST = 0.05, 1.0
"""Error from which a pixel counts as wrong; and the largest that counts in the mean."""


def errors(frame: RGBD, found: Float32Array) -> tuple[float, float]:
    """Mean error of the logarithm, and share of wrong pixels, where the frame has depth and what was found has some."""
    there = is_valid(frame.depth) & (found > 0)
    off = np.abs(np.log(np.minimum(found[there], 1e4) / frame.depth[there]))
    return float(np.minimum(off, MOST).mean()), float((off > WRONG).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--split", default="tune")
    parser.add_argument("--by", type=int, nargs="+", default=[4])
    parser.add_argument("--every", type=int, default=1)
    asked = parser.parse_args()
    rows: dict[tuple[int, str, str], list[tuple[float, float]]] = defaultdict(list)
    for case in list(cases_of(asked.split, asked.shared))[:: asked.every]:
        try:
            frame = case.load().source
        except InputError:  # a frame without room for an object
            continue
        if frame.estimate is not None:
            continue
        for by in asked.by:
            small = np.ascontiguousarray(frame.depth[by // 2 :: by, by // 2 :: by])
            for name, way in WAYS.items():
                rows[by, case.domain, name].append(errors(frame, way(small, frame)))
    for (by, domain, name), found in sorted(rows.items()):
        error, wrong = np.mean(found, 0)
        print(f"1/{by} {domain:10} {name:8} {error:.4f} {wrong:7.2%}  ({len(found)} frames)")


if __name__ == "__main__":
    main()
