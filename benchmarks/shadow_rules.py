"""What each rule of `dlama.perception.shadows` is worth: left out one at a time, by domain.

    python benchmarks/shadow_rules.py ../shared --split tune

The score of a frame is the intersection over union of the found and the true shadow (the contact line left out); where there is
no shadow it is 1 if none is found, else 0. Domains: worlds with exact depth, worlds by the sensors in turn, streets. Printed: the
score with all rules, and the change without each, with its 95 % interval (bootstrap over frames) and processor time.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from clicks import interval
from dlama.datasets.frames import RemovalTruth
from dlama.evaluation.metrics.regions import SMALLEST_SHADOW_PX, darkened_by_shadow, outside_contact_band
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.shadows.find import find_shadow
from dlama.worlds.dataset import open_dataset_or_worlds
from rules import SHADOW_RULES, without
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


def score(found: BoolArray, true: BoolArray, mask: BoolArray) -> float:
    """Of a frame, 0..1."""
    found = found & outside_contact_band(mask)
    if true.sum() < SMALLEST_SHADOW_PX:
        return float(found.sum() < SMALLEST_SHADOW_PX)
    return iou(found, true)


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--split", choices=tuple(WORLDS), default="tune")
    parser.add_argument("--rules", nargs="+", choices=tuple(SHADOW_RULES), default=list(SHADOW_RULES))
    args = parser.parse_args(argv)
    names = ["", *args.rules]
    scores: dict[str, list[list[float]]] = {}
    seconds = np.zeros(len(names))
    for domain, rgbd, mask, true in frames(args.split, args.shared):
        row = []
        for number, rule in enumerate(names):
            with without(rule):
                started = time.process_time()
                row.append(score(find_shadow(rgbd, mask), true, mask))
                seconds[number] += time.process_time() - started
        scores.setdefault(domain, []).append(row)
    print("| without | " + " | ".join(f"{name} ({len(rows)})" for name, rows in scores.items()) + " | time |")
    print("|" + "---|" * (len(scores) + 2))
    for number, rule in enumerate(names):
        cells = []
        for rows in scores.values():
            values = np.array(rows)
            change = values[:, number] - values[:, 0]
            low, high = interval(change[:, None].tolist())
            cells.append(f"{change.mean():+.3f} ({low:+.3f}, {high:+.3f})" if rule else f"{values[:, 0].mean():.3f}")
        print(
            f"| {rule or '(all rules)'} | "
            + " | ".join(cells)
            + f" | {100 * (seconds[number] / seconds[0] - 1):+.0f} % |"
        )


if __name__ == "__main__":
    main()
