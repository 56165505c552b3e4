"""One suite over domains: fillers measured on streets, rooms, tables and worlds that differ in sensor and clutter.

    python benchmarks/bench.py run ../shared -o now.jsonl [--methods dlama/auto paper/migan ...] [--split tune] [--workers 2]
        [--without RULE ... | --each RULE ...] [--sensor phone]
    python benchmarks/bench.py compare before.jsonl now.jsonl [--method dlama/auto] [--against paper/migan]
    python benchmarks/bench.py rules now.jsonl
    python benchmarks/bench.py looks now.jsonl

`run` adds a line of JSON for each case and method and resumes where it stopped; each run of a split is counted in the file's
first lines (`looks`). `compare` pairs cases, averages the relative change within a domain, then over domains, with bootstrap
intervals over the cases of each domain. Colour is measured where the truth is known and unseen: in the mask of a removal, in what
the source does not see of a view, by hole type; exposure between the frames of a pair is undone first, for all alike.

Splits: `tune` may be looked at while something is made, `validate` decides between what was made, `test` is for the closing
figures. Places of one room share a domain; no set of `test` shares frames with the others.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import time
import warnings
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dlama.datasets.frames import Case, RemovalTruth, Truth, ViewTruth
from dlama.datasets.layouts import open_dataset
from dlama.errors import InputError
from dlama.evaluation.metrics.depth import depth_errors
from dlama.evaluation.metrics.lpips import distance_map, features
from dlama.evaluation.metrics.pictures import mse_map
from dlama.evaluation.protocols import ori, vpi
from dlama.evaluation.protocols.methods import Method, ProtocolSettings, run_method
from dlama.evaluation.protocols.scores import Reference, reliability_measures
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.geometry.view import View
from rules import RULES, without
from standing_objects import standing_case
from world_cases import MEASURE, SENSORS, as_seen, world_case

SPLITS = ("tune", "validate", "test")
SETS: dict[str, tuple[tuple[str, str, str], ...]] = {
    # folder, scenes or frames ("" = all), domain
    "tune": (
        ("street", "s03", "street"), ("street", "s05", "street"), ("data/kitchen_vpi", "", "room"),
        ("data/table_removal_a9", "", "table"), ("data/table_removal_a6", "", "table"), ("data/bin_removal", "", "table"),
    ),
    "validate": (
        ("street", "s06", "street"), ("street", "s08", "street"), ("data/lab_removal_31", "", "room"),
        ("data/dining_vpi", "", "room"), ("data/table_removal_b11", "", "table"), ("data/table_vpi", "", "table"),
    ),
    "test": (
        ("data/lab_removal_39", "", "room"), ("data/shelf_sequence", "", "table"), ("data/table_removal_a11", "", "table"),
    ),
}  # fmt: skip
REMOVAL_FRAMES = {"tune": (0, 1, 4, 5, 8, 9, 12), "validate": (0, 2, 3, 6, 7, 10, 11), "test": ()}
"""Frames of an orbit of the street in which the object is removed, and yaws of its views."""
VIEW_YAWS = {"tune": (10, -20, 30, -40, 50, -60), "validate": (-10, 20, -30, 40, -50, 60), "test": ()}
WORLDS = {"tune": (1000, 60), "validate": (2000, 60), "test": (3000, 60)}
"""First number and count of the held-out worlds of a split: removals in clutter and views, in turn."""
STANDING: dict[str, tuple[tuple[str, int, int], ...]] = {
    # folder, every so many frames, objects in each
    "tune": (("data/kitchen_sequence", 3, 1),),
    "validate": (("data/dining_vpi", 1, 2), ("data/table_vpi", 1, 2), ("data/lab_removal_31", 1, 2)),
    "test": (("data/shelf_sequence", 1, 1),),
}
"""Recorded frames in which objects are put on surfaces and removed (domain `clutter`)."""
SHELF_EVERY = 8
EXACT = ("street", "clutter", "world")
"""Domains whose depth is exact, or a camera's with few holes: what `--sensor` measures anew. Estimated depth needs no depth, so
that rooms and tables are added."""
SETTINGS = ProtocolSettings(mask_changes=(), object_dilations=())
MARGIN = 48
"""Pixels round what is measured that LPIPS sees."""
SHOWN = (
    "mask lpips", "mask mse", "mask mae", "unseen lpips", "unseen mse", "unseen mae",
    "disoccluded lpips", "disoccluded mse", "out-of-view lpips", "out-of-view mse", "seen lpips", "seen mse", "seen mae",
    "ece", "seconds",
)  # fmt: skip

RULE_MEASURES = (
    "mask lpips", "mask mse", "mask mae", "unseen lpips", "unseen mse", "unseen mae", "disoccluded lpips", "disoccluded mse",
    "ece", "seconds",
)  # fmt: skip


@dataclass(frozen=True)
class BenchCase:
    """One input with its truth, and where it counts."""

    name: str
    domain: str
    load: Callable[[], Truth]
    yaw: float | None = None
    """Of an orbit's view, degrees."""


def cases_of(split: str, shared: Path) -> Iterator[BenchCase]:
    """All cases of a split."""
    for folder, only, domain in SETS[split]:
        for case in (*open_dataset(shared / folder).of("vpi"), *open_dataset(shared / folder).of("ori")):
            if (not only or case.scene == only) and expected_yaw(case, split, folder):
                yield BenchCase(f"{folder}/{case.scene}/{case.protocol}/{case.frame}", domain, case.load, case.yaw)
    for folder, every, count in STANDING[split]:
        for place, frame in enumerate(open_dataset(shared / folder).frames[::every]):
            for number in range(count):
                name = f"standing/{folder}/ori/{frame.name}-{number}"
                yield BenchCase(name, "clutter", partial(standing_case, frame.load, 100 * place + number))
    first, count = WORLDS[split]
    for number in range(first, first + count):
        sensor = SENSORS[number // 2 % len(SENSORS)]
        kind = "removal" if number % 2 == 0 else "view"
        name = f"worlds/{sensor}/{'ori' if kind == 'removal' else 'vpi'}/{number}"
        yield BenchCase(
            name, "world" if sensor != "estimated" else "estimated", partial(world_case, number, kind, sensor)
        )


def seen_by(case: BenchCase, sensor: str) -> BenchCase:
    """The case with its exact depth as a sensor gives it."""
    if case.domain == "world":
        *_, protocol, number = case.name.split("/")
        kind = "removal" if protocol == "ori" else "view"
        return dataclasses.replace(case, load=partial(world_case, int(number), kind, sensor))
    return dataclasses.replace(case, load=partial(load_as_seen, case.load, sensor, zlib.crc32(case.name.encode())))


def load_as_seen(load: Callable[[], Truth], sensor: str, seed: int) -> Truth:
    """A case whose source is as a sensor gives it."""
    truth = load()
    return dataclasses.replace(truth, source=as_seen(truth.source, sensor, np.random.default_rng(seed)))


def expected_yaw(case: Case, split: str, folder: str) -> bool:
    """Whether a frame of an orbit or a sequence is one of the suite's."""
    if folder == "street":
        if case.protocol == "ori":
            return int(case.frame[-4:]) in REMOVAL_FRAMES[split]
        return case.yaw in VIEW_YAWS[split]
    return folder != "data/shelf_sequence" or int("".join(filter(str.isdigit, case.frame)) or 0) % SHELF_EVERY == 0


def measure(truth: Truth, method: Method) -> dict[str, float]:
    """The numbers of one case and method: squared error, LPIPS and depth error of each region that the source does not show."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if isinstance(truth, RemovalTruth):
            reference, unknown = ori.reference_of(truth, SETTINGS), truth.mask
            names = {"mask": truth.mask}
            mask, camera = truth.mask, truth.source.camera
        else:
            assert isinstance(truth, ViewTruth)
            reference, mask, camera = vpi.target_reference(truth, SETTINGS), None, truth.target.camera
            unknown = reference.regions["unseen"]
            names = {name: reference.regions[name] for name in ("unseen", "disoccluded", "out-of-view")}
        run_ = run_method(method, truth.source, camera, mask)
        view, everywhere = run_.view(), np.ones(unknown.shape, np.bool_)
        found = {"seconds": run_.seconds} | measure_regions(view, reference, reference.within(unknown), names)
        if isinstance(truth, ViewTruth):
            found |= measure_regions(view, reference, reference.within(everywhere) & ~unknown, {"seen": everywhere})
        found |= {one.metric: one.value for one in reliability_measures(run_, reference)}
    return found


def measure_regions(view: View, reference: Reference, part: BoolArray, names: dict[str, BoolArray]) -> dict[str, float]:
    """Colour and depth error in each region within a part (H x W) of a view, which is true elsewhere."""
    mine = np.where(part[..., None], reference.match_exposure(view.color), reference.color)
    squared, distance = mse_map(reference.color, mine), lpips_map(reference.color, mine, part)
    found = {}
    for name, region in names.items():
        chosen = region & part
        if chosen.sum() < SETTINGS.smallest_region:
            continue
        found |= {f"{name} mse": float(squared[chosen].mean()), f"{name} lpips": float(distance[chosen].mean())}
        known = chosen & (reference.depth > 0)
        if known.sum() >= SETTINGS.smallest_region:
            found[f"{name} mae"] = depth_errors(view.depth, reference.depth, known)["mae"]
    return found


def lpips_map(truth: UInt8Array, mine: UInt8Array, region: BoolArray) -> np.ndarray:
    """H x W LPIPS, computed in the box of the region with a margin, 0 beyond it."""
    rows, columns = (np.flatnonzero(region.any(axis)) for axis in (1, 0))
    out = np.zeros(region.shape)
    if rows.size:
        box = tuple(
            slice(max(0, each[0] - MARGIN), max(each[-1] + 1 + MARGIN, min(size, max(0, each[0] - MARGIN) + 64)))
            for each, size in ((rows, region.shape[0]), (columns, region.shape[1]))
        )
        taps = [features(np.ascontiguousarray(one[box])) for one in (truth, mine)]
        out[box] = distance_map(*taps, truth[box].shape[:2])
    return out


def turn_off(rules: Sequence[str]) -> None:
    """Run a worker without these rules."""
    for rule in rules:
        RULES[rule]()


Run = tuple[Method, str]
"""A method, and the rule that is switched off in it ("": none)."""


def label_of(run_: Run) -> str:
    """As results and `compare` name it: `dlama/auto`, `dlama/auto -foliage`."""
    return f"{run_[0].label} -{run_[1]}" if run_[1] else run_[0].label


def run_case(case: BenchCase, runs: Sequence[Run]) -> list[dict[str, Any]]:
    """One case, all methods, with all rules and without each of some."""
    cv2.setNumThreads(1)
    rows = []
    try:
        truth = dataclasses.replace(case.load(), exposure_varies=not case.name.startswith(("worlds", "standing")))
    except InputError as error:  # a frame without room for an object
        print(f"{case.name}: left out, {error}")
        return rows
    for method, rule in runs:
        row: dict[str, Any] = {
            "case": case.name,
            "domain": case.domain,
            "yaw": case.yaw,
            "method": label_of((method, rule)),
        }
        try:
            with without(rule):
                row["measures"] = measure(truth, method)
        except Exception as error:
            row["error"] = f"{type(error).__name__}: {error}"
        rows.append(row)
    return rows


def rows_of(path: Path) -> list[dict[str, Any]]:
    """The lines of a file of results."""
    return [json.loads(line) for line in path.read_text("utf-8").splitlines() if line] if path.exists() else []


def run(asked: argparse.Namespace) -> None:
    os.environ["OMP_NUM_THREADS"] = "1"  # cases run side by side
    runs = [(Method(*name.split("/")), rule) for name in asked.methods for rule in ("", *asked.each)]
    done = {(row["case"], row["method"]) for row in rows_of(asked.output) if "case" in row}
    cases = [case for split in asked.split for case in cases_of(split, asked.shared)]
    cases = [case for case in cases if asked.only in case.name][:: asked.every]
    domains = EXACT if asked.sensor != "estimated" else (*EXACT, "room", "table")
    cases = [seen_by(case, asked.sensor) for case in cases if case.domain in domains] if asked.sensor else cases
    todo = [(case, [one for one in runs if (case.name, label_of(one)) not in done]) for case in cases]
    with (
        asked.output.open("a", encoding="utf-8") as stream,
        ProcessPoolExecutor(asked.workers, initializer=turn_off, initargs=(asked.without,)) as pool,
    ):
        stream.write(json.dumps({"look": asked.split, "at": time.strftime("%F %T")}) + "\n")
        futures = [pool.submit(run_case, case, missing) for case, missing in todo if missing]
        for number, future in enumerate(as_completed(futures), 1):
            for row in future.result():
                stream.write(json.dumps(row) + "\n")
                if "error" in row:
                    print(f"{row['case']} {row['method']}: {row['error']}")
            stream.flush()
            if number % 20 == 0:
                print(f"{number} of {len(futures)}", flush=True)
    summary(rows_of(asked.output))


Table = dict[str, dict[str, dict[str, float]]]
"""Method -> case -> measure -> value."""


def table_of(rows: list[dict[str, Any]]) -> tuple[Table, dict[str, str]]:
    """The rows by method and case, and each case's domain."""
    table: Table = defaultdict(dict)
    domains = {}
    for row in rows:
        if "measures" in row:
            table[row["method"]][row["case"]] = row["measures"]
            domains[row["case"]] = row["domain"]
    return table, domains


def summary(rows: list[dict[str, Any]]) -> None:
    """Means by domain and method."""
    table, domains = table_of(rows)
    for domain in sorted(set(domains.values())):
        print(f"\n{domain}\n{'':24}" + "".join(f"{name.replace('out-of-view', 'oov')[:14]:>15}" for name in SHOWN))
        for method, of_method in table.items():
            cells = []
            for name in SHOWN:
                values = [m[name] for case, m in of_method.items() if domains[case] == domain and name in m]
                cells.append(f"{np.nanmean(values):15.4g}" if values else f"{'-':>15}")
            print(f"{method:24}" + "".join(cells))


def compare(asked: argparse.Namespace) -> None:
    """The relative change of each measure, method against `--against`, paired by case."""
    before, domains = table_of(rows_of(asked.before))
    now, more = table_of(rows_of(asked.now))
    domains |= more
    base, mine = before[asked.against or asked.method], now[asked.method]
    shared = [case for case in mine if case in base and asked.only in case]
    print(f"{asked.now.name} against {asked.before.name}, {len(shared)} cases; below zero: {asked.now.name} is lower")
    print("change in % of the mean, by domain, and the mean over domains with a 95 % interval")
    for name in SHOWN:
        pairs = paired(base, mine, name, shared, domains)
        if pairs:
            print(f"{name:24} {change_in_words(pairs)}")


def paired(
    base: dict[str, dict[str, float]],
    mine: dict[str, dict[str, float]],
    name: str,
    cases: list[str],
    domains: dict[str, str],
) -> dict[str, np.ndarray]:
    """Domain -> N x 2: a measure of each case in the one table and in the other."""
    pairs: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for case in cases:
        both = base[case].get(name, np.nan), mine[case].get(name, np.nan)
        if np.isfinite(both).all():
            pairs[domains[case]].append(both)
    return {domain: np.array(values) for domain, values in sorted(pairs.items())}


def change_in_words(pairs: dict[str, np.ndarray]) -> str:
    """The mean over domains, its interval, and each domain's change, in %."""
    rng = np.random.default_rng(0)
    changes = {domain: change_of(values) for domain, values in pairs.items()}
    drawn = [np.mean([change_of(v[rng.integers(len(v), size=len(v))]) for v in pairs.values()]) for _ in range(1000)]
    low, high = np.percentile(drawn, (2.5, 97.5))
    each = "  ".join(f"{domain} {value:+.1f} ({len(pairs[domain])})" for domain, value in changes.items())
    return f"{np.mean(list(changes.values())):+6.1f}  [{low:+.1f}, {high:+.1f}]   {each}"


def rules(asked: argparse.Namespace) -> None:
    """What each rule is worth: the change without it, of a file that `run --each` wrote."""
    table, domains = table_of(rows_of(asked.before))
    for method, mine in table.items():
        base_method, _, rule = method.partition(" -")
        base = table.get(base_method, {})
        cases = [case for case in mine if case in base and asked.only in case]
        changed = [case for case in cases if {**mine[case], "seconds": 0} != {**base[case], "seconds": 0}]
        if not rule or not cases:
            continue
        print(f"\n{base_method} without {rule}: differs in {len(changed)} of {len(cases)} cases")
        for name in RULE_MEASURES:
            pairs = paired(base, mine, name, cases, domains)
            if pairs and (name == "seconds" or any((v[:, 0] != v[:, 1]).any() for v in pairs.values())):
                print(f"    {name:18} {change_in_words(pairs)}")


def change_of(pairs: np.ndarray) -> float:
    """% by which the second column's mean differs from the first's."""
    before, now = pairs.mean(0)
    return float(100 * (now / before - 1)) if before else 0.0


def looks(asked: argparse.Namespace) -> None:
    """How often each split was looked at."""
    counts: dict[str, int] = defaultdict(int)
    for row in rows_of(asked.before):
        for split in row.get("look", ()):
            counts[split] += 1
    print(dict(counts))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True)
    one = verbs.add_parser("run")
    one.add_argument("shared", type=Path)
    one.add_argument("-o", "--output", type=Path, required=True)
    one.add_argument("--methods", nargs="+", default=["dlama/auto", "paper/migan", "paper/telea"])
    one.add_argument("--split", nargs="+", choices=SPLITS, default=["tune"])
    one.add_argument("--without", nargs="*", choices=RULES, default=[], help="rules that are turned off")
    one.add_argument("--each", nargs="*", choices=RULES, default=[], help="rules that are turned off one at a time")
    one.add_argument("--only", default="", help="part of a case's name")
    one.add_argument("--every", type=int, default=1)
    one.add_argument("--sensor", choices=(*MEASURE, "estimated"), help="measures exact depth anew")
    one.add_argument("--workers", type=int, default=os.cpu_count())
    one.set_defaults(do=run)
    two = verbs.add_parser("compare")
    two.add_argument("before", type=Path)
    two.add_argument("now", type=Path)
    two.add_argument("--method", default="dlama/auto")
    two.add_argument("--against")
    two.add_argument("--only", default="")
    two.set_defaults(do=compare)
    four = verbs.add_parser("rules")
    four.add_argument("before", type=Path)
    four.add_argument("--only", default="")
    four.set_defaults(do=rules)
    three = verbs.add_parser("looks")
    three.add_argument("before", type=Path)
    three.set_defaults(do=looks)
    asked = parser.parse_args()
    asked.do(asked)


if __name__ == "__main__":
    main()
