"""What each rule of `dlama.perception.shadows` is worth: left out one at a time, by domain.

    python benchmarks/shadow_rules.py ../shared --split tune

The score of a frame is the intersection over union of the found and the true shadow (the contact line left out); where there is
no shadow it is 1 if none is found, else 0. Domains: worlds with exact depth, worlds by the sensors in turn, streets. Printed: the
score with all rules, and the change without each, with its 95 % interval (bootstrap over frames) and processor time.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from clicks import leave_out_rules
from dlama.datasets.frames import RemovalTruth
from dlama.evaluation.metrics.regions import SMALLEST_SHADOW_PX, darkened_by_shadow, outside_contact_band
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.shadows.find import find_shadow
from dlama.worlds.dataset import open_dataset_or_worlds
from rules import SHADOW_RULES
from world_cases import SENSORS, as_seen

WORLDS = {"tune": "worlds:16:3000", "validate": "worlds:16:5000"}
STREETS = {"tune": ("s03", "s05"), "validate": ("s06", "s08")}


def frames(split: str, shared: Path) -> Iterator[tuple[str, RGBD, BoolArray, BoolArray]]:
    """Domain, picture, the object's mask and its true shadow."""
    worlds = [case for case in open_dataset_or_worlds(WORLDS[split]).cases if case.protocol == "ori" and case.yaw == 0]
    streets = open_dataset_or_worlds(str(shared / "street"), scenes=STREETS[split]).cases
    for number, case in enumerate([*worlds, *[case for case in streets if case.protocol == "ori"][::4]]):
        truth = case.load()
        assert isinstance(truth, RemovalTruth)
        true = darkened_by_shadow(truth.source.color, truth.without.color, truth.mask)
        yield "street" if number >= len(worlds) else "world", truth.source, truth.mask, true
        if number < len(worlds):
            seen = as_seen(truth.source, SENSORS[1 + number % 3], np.random.default_rng(number))
            yield "sensor", seen, truth.mask, true


def scores_of(rgbd: RGBD, mask: BoolArray, true: BoolArray) -> list[float]:
    """Of a frame, 0..1."""
    found = find_shadow(rgbd, mask) & outside_contact_band(mask)
    if true.sum() < SMALLEST_SHADOW_PX:
        return [float(found.sum() < SMALLEST_SHADOW_PX)]
    return [iou(found, true)]


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--split", choices=tuple(WORLDS), default="tune")
    parser.add_argument("--rules", nargs="+", choices=tuple(SHADOW_RULES), default=list(SHADOW_RULES))
    args = parser.parse_args(argv)
    cases = frames(args.split, args.shared)
    leave_out_rules(((domain, partial(scores_of, *case)) for domain, *case in cases), args.rules)


if __name__ == "__main__":
    main()
