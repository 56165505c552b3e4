"""Cameras that are completed one after another in one scene, next to completing each alone, against the truth.

python benchmarks/several_cameras.py --worlds 40 56                    # procedural worlds of these seeds, at 4, 8, 12, -8 degrees
python benchmarks/several_cameras.py --street ../shared/street         # the street benchmark's scenes, at 10 to 40 degrees
python benchmarks/several_cameras.py --worlds 40 56 --without RULE     # a rule of rules.py switched off
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import dlama
from dlama.geometry.codes import HoleType
from dlama.worlds.dataset import world
from photo3d import SCENES, scores, street_truths
from rules import without

YAWS = (4.0, 8.0, 12.0, -8.0)
TYPES = (HoleType.DISOCCLUDED, HoleType.OUT_OF_VIEW)


def world_jobs(first: int, last: int) -> Iterator[tuple[dlama.RGBD, list[dlama.RGBD]]]:
    """A source of each world, and the truth of its cameras."""
    for seed in range(first, last):
        made = world(seed)
        source = made.frame(made.camera())
        yield source, [made.frame(dlama.orbit(source, yaw)) for yaw in YAWS]


def street_jobs(folder: Path) -> Iterator[tuple[dlama.RGBD, list[dlama.RGBD]]]:
    """The scenes at yaw 0, and their truth to the right and to the left."""
    for scene in SCENES:
        for side in (1, -1):
            truths = street_truths(folder, scene, range(10 * side, 50 * side, 10 * side))
            yield truths[0].source, [truth.target for truth in truths]


def compare(jobs: Iterator[tuple[dlama.RGBD, list[dlama.RGBD]]], rule: str) -> None:
    """A line a hole type and camera: the change from each camera alone, over all scenes."""
    rows: dict[tuple[str, int], list[tuple[float, ...]]] = {}
    for source, truths in jobs:
        with without(rule):
            together = dlama.complete(source, [truth.camera for truth in truths])
        for at, (view, truth) in enumerate(zip(together.views[1:], truths[1:]), 2):  # the first is alone
            alone = dlama.complete(source, [truth.camera])
            for code in TYPES:
                region = alone.warped[0].hole_type == code.value
                if region.sum() >= 100:
                    both = (scores(color, truth.color, region) for color in (view.color, alone.view.color))
                    rows.setdefault((code.name, at), []).append(sum(both, ()))
    for (name, at), cases in sorted(rows.items()):
        mean = np.mean(cases, 0)
        change = mean[:2] / mean[2:] - 1
        print(f"{name}, camera {at}, {len(cases)} scenes: LPIPS {mean[0]:.4f} ({change[0]:+.1%}), ", end="")
        print(f"MSE {mean[1]:.0f} ({change[1]:+.1%})")


def main() -> None:
    """Worlds or streets."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, nargs=2, default=(0, 4), metavar=("FIRST", "LAST"))
    parser.add_argument("--street", type=Path)
    parser.add_argument("--without", default="", metavar="RULE")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    compare(street_jobs(asked.street) if asked.street else world_jobs(*asked.worlds), asked.without)


if __name__ == "__main__":
    main()
