"""One click on objects whose mask is known: how well it is found, by domain.

    python benchmarks/clicks.py ../shared --split tune
    python benchmarks/clicks.py ../shared --split validate --domains world stand -o clicks.json
    python benchmarks/clicks.py ../shared --rules stands click-network
    python benchmarks/clicks.py ../shared --split validate --prompt box

Domains: procedural worlds by sensor (`world`), the same with objects on islands, plinths and tables (`stand`), streets with exact
and with estimated depth, real pictures with a depth camera's and with estimated depth, photos with a clear object and photos with
objects put on them (`photo`). The click is the innermost pixel of what is seen of the object; what stands on the object does not
count. In `background` clicks lie on ground, walls, ceilings and the sky of worlds, where an error is right: 1, not an IoU.
Printed: mean IoU with its 95 % interval (bootstrap by picture), share of clicks under .5, processor seconds a picture and
click. Five minutes on one core. With --rules the change of IoU without each rule of `rules.MASK_RULES` (all of them: --rules
all) instead. With --prompt box a box is drawn round each object, WIDER on each side at most, instead of a click on it; with
--prompt both there is a click, too.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from click_photos import (
    TUNE,
    VALIDATE,
    clear_objects,
    innermost_pixel,
    largest_region,
    photo_with_objects,
    photos_of,
)
from click_worlds import ClickScene, ClickWorld, objects_in_sight
from dlama.datasets.frames import RemovalTruth
from dlama.datasets.layouts import open_dataset
from dlama.errors import MaskError
from dlama.geometry.holes import dilate_mask, iou
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.object_masks import MaskSession
from rules import MASK_RULES, without
from world_cases import FARTHEST_M, SENSORS, as_seen, scaled_estimate

FIRST = {"tune": 1000, "validate": 2000}
HELD_OUT = 2_000_000_000
WORLDS, STANDS, MOST_CLICKS = 10, 8, 4
BESIDE_PX = 12
"""Least distance of a click on the background from objects."""
SHARES = (0.004, 0.12)
"""Of the picture, that an object covers."""
WIDER = 0.15
"""Largest distance of a side of a box from the object, over the object's width or height."""
ONE_PIECE = 0.8
"""Least share of an object that hangs together with the click (gaps of 3 px closed)."""
PHOTOS, PICTURES = {"tune": TUNE, "validate": VALIDATE}, 24
"""Groups of photos that nothing learns from; photos with objects put on them."""
STREETS = {"tune": ("s03", "s05"), "validate": ("s06", "s08")}
REAL = {
    "tune": ("bin_removal", "table_removal_a6", "lab_removal_31"),
    "validate": ("table_removal_a9", "table_removal_a11", "table_removal_b11", "lab_removal_39"),
}


@dataclasses.dataclass(frozen=True, eq=False)
class Click:
    """A click, and what it should find."""

    at: tuple[int, int]
    """x, y."""
    true: BoolArray
    """H x W, the object's mask; empty: nothing."""
    ignored: BoolArray
    """H x W, the pixels that do not count."""

    def score(self, found: BoolArray) -> float:
        """Intersection over union; of a click on nothing 1 for an empty mask, else 0."""
        return iou(found & ~self.ignored, self.true) if self.true.any() else float(not found.any())


@dataclasses.dataclass(frozen=True, eq=False)
class ClickCase:
    """A picture, and clicks in it."""

    domain: str
    name: str
    frame: RGBD
    clicks: list[Click]


def click_amid(true: BoolArray, ignored: BoolArray | None = None) -> Click:
    """A click on the innermost pixel of an object."""
    return Click(innermost_pixel(true), true, np.zeros_like(true) if ignored is None else ignored)


def clickable(scene: ClickScene, only_standing: bool) -> list[Click]:
    """The objects of a scene that a user could click on."""
    found = []
    for number in objects_in_sight(scene, *SHARES):
        mask = scene.mask(number)
        if np.median(scene.frame.depth[mask]) > FARTHEST_M:
            continue
        if (largest_region(dilate_mask(mask, 2)) & mask).sum() < ONE_PIECE * mask.sum():
            continue
        base = scene.stands_on.get(number)
        if not only_standing or (base is not None and scene.mask(base).any()):
            found.append(click_amid(mask, scene.on_it(number)))
    return found[:MOST_CLICKS]


def on_background(scene: ClickScene, rng: np.random.Generator) -> list[Click]:
    """Clicks away from the objects of a scene."""
    free = np.argwhere(~dilate_mask(~scene.background, BESIDE_PX))
    nothing = np.zeros(scene.group.shape, np.bool_)
    return [Click((column, row), nothing, nothing) for row, column in rng.permutation(free)[:MOST_CLICKS].tolist()]


def world_clicks(split: str, kind: str) -> Iterator[ClickCase]:
    """Worlds as each sensor sees them. kind: world, stand or background."""
    for number in range(FIRST[split], FIRST[split] + (STANDS if kind == "stand" else WORLDS)):
        made = ClickWorld(HELD_OUT + number, stands=kind == "stand")
        rng = np.random.default_rng([number, 11])
        scene = made.scene(made.world.camera(float(rng.uniform(-40, 40)), 512, float(rng.uniform(60, 95))))
        clicks = on_background(scene, rng) if kind == "background" else clickable(scene, kind == "stand")
        for sensor in (*SENSORS, "lidar"):
            frame = as_seen(scene.frame, sensor, np.random.default_rng([number, 5]))
            yield ClickCase(f"{kind} {sensor}", str(number), frame, clicks)


def data_set_clicks(folder: Path, domain: str, scenes: Sequence[str], every: int) -> Iterator[ClickCase]:
    """Frames of data sets with an object's mask, with their depth and with estimated depth."""
    dataset = open_dataset(folder)
    for case in [case for case in dataset.cases if case.protocol == "ori" and (not scenes or case.scene in scenes)][
        ::every
    ]:
        truth = case.load()
        assert isinstance(truth, RemovalTruth)
        clicks = [click_amid(truth.mask)]
        if folder.name.endswith("removal") or "removal" in folder.name:
            count, labels, stats, _ = cv2.connectedComponentsWithStats(truth.mask.astype(np.uint8), connectivity=8)
            parts = [labels == n for n in range(1, count) if stats[n, cv2.CC_STAT_AREA] > 0.003 * truth.mask.size]
            clicks = [click_amid(part, truth.mask & ~part) for part in parts]
        name = f"{folder.name}/{case.scene}/{case.frame}"
        yield ClickCase(domain, name, truth.source, clicks)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield ClickCase(f"{domain} estimated", name, scaled_estimate(truth.source), clicks)


def photo_clicks(split: str, shared: Path) -> Iterator[ClickCase]:
    """Photos with a clear object, and objects put onto photos."""
    photos = photos_of(shared / "photos", PHOTOS[split])
    objects = clear_objects(photos)
    for put in (False, True):
        for number in range(PICTURES if put else len(objects)):
            rng = np.random.default_rng([number, 13, put])
            frame, masks = photo_with_objects(objects if put else objects[number:][:1], photos, rng, put)
            seen = [mask for mask in masks if mask.mean() > SHARES[0]]
            if frame is not None and seen:
                name = "objects put on photos" if put else "photo"
                yield ClickCase(name, str(number), frame, [click_amid(mask) for mask in seen])


def cases_of(split: str, shared: Path, domains: Sequence[str]) -> Iterator[ClickCase]:
    """All cases of a split."""
    for kind in ("world", "stand", "background"):
        if kind in domains:
            yield from world_clicks(split, kind)
    if "street" in domains:
        yield from data_set_clicks(shared / "street", "street", STREETS[split], 3)
    if "real" in domains:
        for name in REAL[split]:
            yield from data_set_clicks(shared / "data" / name, "real", (), 1)
    if "photo" in domains:
        yield from photo_clicks(split, shared)


def interval(by_picture: Sequence[Sequence[float]], rounds: int = 1000) -> tuple[float, float]:
    """95 % of the mean over all clicks, pictures drawn again."""
    rng = np.random.default_rng(0)
    sums, counts = np.array([sum(each) for each in by_picture]), np.array([len(each) for each in by_picture])
    drawn = rng.integers(0, len(sums), (rounds, len(sums)))
    means = sums[drawn].sum(1) / np.maximum(counts[drawn].sum(1), 1)
    low, high = np.quantile(means, (0.025, 0.975))
    return float(low), float(high)


def box_round(click: Click) -> tuple[float, float, float, float]:
    """x, y, width and height of a box round the object, as a user draws it."""
    rng = np.random.default_rng(list(click.at))
    spans = []
    for axis in (0, 1):
        there = np.flatnonzero(click.true.any(axis))
        first, size = int(there[0]), int(there[-1] + 1 - there[0])
        before, after = (round(size * rng.uniform(0, WIDER)) for _ in range(2))
        start = max(0, first - before)
        spans.append((start, min(click.true.shape[1 - axis], first + size + after) - start))
    return spans[0][0], spans[1][0], spans[0][1], spans[1][1]


def find_clicked(session: MaskSession, click: Click, candidate: str = "object", prompt: str = "click") -> BoolArray:
    """The mask of one click, of a box or of both (prompt: click, box, both); empty where none is found."""
    try:
        box = None if prompt == "click" else box_round(click)
        return session.find(clicks=[] if prompt == "box" else [click.at], box=box, candidate=candidate).mask
    except MaskError:
        return np.zeros_like(click.true)


def leave_out_rules(cases: Iterable[tuple[str, Callable[[], list[float]]]], rules: Sequence[str]) -> None:
    """Print by domain the mean score, what it changes without each rule, and the change of processor time.

    cases: the domain of each, and what computes its scores.
    """
    scores: dict[str, list[list[list[float]]]] = {}
    seconds = np.zeros(len(rules) + 1)
    for domain, measure in cases:
        by_rule = []
        for number, rule in enumerate(["", *rules]):
            with without(rule):
                started = time.process_time()
                by_rule.append(measure())
                seconds[number] += time.process_time() - started
        scores.setdefault(domain, []).append(by_rule)
    print("| without | " + " | ".join(f"{name} ({len(each)})" for name, each in scores.items()) + " | time |")
    print("|" + "---|" * (len(scores) + 2))
    means = [f"{np.mean(np.concatenate([of_case[0] for of_case in each])):.3f}" for each in scores.values()]
    print(f"| (all rules) | {' | '.join(means)} | |")
    for number, rule in enumerate(rules, 1):
        cells = []
        for each in scores.values():
            changes = [np.subtract(of_case[number], of_case[0]).tolist() for of_case in each]
            low, high = interval(changes)
            cells.append(f"{np.mean(np.concatenate(changes)):+.3f} ({low:+.3f}, {high:+.3f})")
        print(f"| {rule} | {' | '.join(cells)} | {100 * (seconds[number] / seconds[0] - 1):+.0f} % |")


def scores_of(case: ClickCase) -> list[float]:
    """Of the clicks in a picture."""
    session = MaskSession(case.frame)
    return [click.score(find_clicked(session, click)) for click in case.clicks]


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--split", choices=tuple(FIRST), default="tune")
    parser.add_argument("--domains", nargs="+", default=["world", "stand", "background", "street", "real", "photo"])
    parser.add_argument("--candidate", default="object")
    parser.add_argument("--prompt", choices=("click", "box", "both"), default="click")
    parser.add_argument("-o", "--output", type=Path, help="IoU of each click as JSON")
    parser.add_argument("--rules", nargs="+", choices=("all", *MASK_RULES), help="left out one at a time")
    args = parser.parse_args(argv)
    if args.rules:
        rules = list(MASK_RULES) if "all" in args.rules else args.rules
        cases = cases_of(args.split, args.shared, args.domains)
        leave_out_rules(((case.domain, partial(scores_of, case)) for case in cases), rules)
        return
    values: dict[str, dict[str, list[float]]] = {}
    seconds: dict[str, list[float]] = {}
    for case in cases_of(args.split, args.shared, args.domains):
        started = time.process_time()
        session = MaskSession(case.frame)
        for click in [each for each in case.clicks if args.prompt == "click" or each.true.any()]:
            found = find_clicked(session, click, args.candidate, args.prompt)
            values.setdefault(case.domain, {}).setdefault(case.name, []).append(click.score(found))
        if case.clicks:
            seconds.setdefault(case.domain, []).append((time.process_time() - started) / len(case.clicks))
    print("| domain | clicks | IoU | 95 % | under .5 | seconds |\n|---|---|---|---|---|---|")
    for domain, by_picture in values.items():
        every = [value for each in by_picture.values() for value in each]
        low, high = interval(list(by_picture.values()))
        under = 100 * float(np.mean(np.array(every) < 0.5))
        print(
            f"| {domain} | {len(every)} | {np.mean(every):.3f} | {low:.3f} to {high:.3f} | {under:.0f} % | "
            f"{np.mean(seconds[domain]):.2f} |"
        )
    if args.output:
        args.output.write_text(json.dumps(values))


if __name__ == "__main__":
    main()
