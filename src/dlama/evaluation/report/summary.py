"""Rows of results in; means per yaw, method, region and metric with 95 % intervals over scenes out, also as summary.json.

A mean is over frames. Its interval is a bootstrap over scenes (Efron 1979): scenes are drawn with replacement, each with all
its frames, since frames of one scene are not independent; the percentiles 2.5 and 97.5 of the means of many draws. With one
scene there is no interval. Frames where a region is empty (nan) do not count.
"""

from __future__ import annotations

import json
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dlama.evaluation.report.columns import Which
from dlama.evaluation.runner.store import Row
from dlama.geometry.camera import Float64Array
from dlama.writing.atomic_write import write_file

ALL = "all"
"""The yaw of a mean over every frame."""
RESAMPLES = 1000


class Key(NamedTuple):
    """What a mean is of."""

    protocol: str
    dataset: str
    yaw: str
    """`all`; `±10`: both signs; `+10`, `-10`: one; `≈10`: real pairs about that far apart."""
    method: str
    region: str
    modality: str
    metric: str


class Mean(NamedTuple):
    """A mean with its interval (None: fewer than two scenes, or a value that is infinite)."""

    value: float
    low: float | None
    high: float | None
    frames: int
    scenes: int


@dataclass(frozen=True)
class Summary:
    """Every mean, and what it rests on."""

    means: dict[Key, Mean]
    methods: tuple[str, ...]
    """In the order in which they were asked for; variants after the methods."""
    about: dict[str, Any] = field(default_factory=dict)
    """Settings, hash, versions, command, counts: what stands next to the tables."""

    def of(self, **chosen: str) -> dict[Key, Mean]:
        """The means whose key has those fields."""
        return {key: one for key, one in self.means.items() if all(getattr(key, k) == v for k, v in chosen.items())}

    def values(self, field_name: str, **chosen: str) -> list[str]:
        """The different values of one field among those, in order of appearance; yaws from small to large."""
        found = list(dict.fromkeys(getattr(key, field_name) for key in self.of(**chosen)))
        return sorted(found, key=yaw_order) if field_name == "yaw" else found

    def places(self) -> Iterator[Place]:
        """Each data set of each protocol, in order of appearance."""
        for protocol in self.values("protocol"):
            for dataset in self.values("dataset", protocol=protocol):
                yield Place(self, protocol, dataset)


class Place(NamedTuple):
    """One protocol on one data set, in a summary."""

    summary: Summary
    protocol: str
    dataset: str

    def mean(self, yaw: str, method: str, which: Which) -> Mean | None:
        """None: it was not measured."""
        return self.summary.means.get(Key(self.protocol, self.dataset, yaw, method, *which))

    def values(self, field_name: str) -> list[str]:
        """The different values of one field of its means; yaws from small to large."""
        return self.summary.values(field_name, protocol=self.protocol, dataset=self.dataset)

    def of(self, **chosen: str) -> dict[Key, Mean]:
        """The means whose key has those fields, too."""
        return self.summary.of(protocol=self.protocol, dataset=self.dataset, **chosen)


def summarise(rows: Sequence[Row], *, seed: int = 0, about: dict[str, Any] | None = None) -> Summary:
    """Means over frames, with intervals over scenes drawn with that seed; the same rows give the same numbers."""
    values: dict[Key, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    labels = yaw_labels(rows)
    for row in rows:
        if math.isnan(row.value):
            continue
        own = labels[row.protocol, row.dataset, row.yaw]
        for yaw in own[:2] if "+" in row.recipe else own:  # a variant has no signs by themselves
            key = Key(row.protocol, row.dataset, yaw, row.method, row.region, row.modality, row.metric)
            values[key][row.scene].append(row.value)
    methods = dict.fromkeys(row.method for row in rows)
    ordered = sorted(methods, key=lambda method: "+" in method.split("/")[0])
    means = {key: mean_of(scenes, seed) for key, scenes in values.items()}
    return Summary(means, tuple(ordered), about or {})


def mean_of(scenes: dict[str, list[float]], seed: int) -> Mean:
    """Of the values of each scene's frames; with an interval where there are two scenes or more, and the mean is finite."""
    every = [value for one in scenes.values() for value in one]
    mean = math.fsum(every) / len(every) if all(map(math.isfinite, every)) else sum(every) / len(every)
    low = high = None
    if len(scenes) > 1 and math.isfinite(mean):
        sums, counts = np.array([(math.fsum(one), len(one)) for one in scenes.values()]).T
        low, high = interval(sums, counts, seed)
    return Mean(mean, low, high, len(every), len(scenes))


@lru_cache(maxsize=16)
def draws(scenes: int, seed: int) -> Float64Array:
    """RESAMPLES x scenes: how often each scene was drawn, with replacement."""
    drawn = np.random.default_rng([seed, scenes]).integers(0, scenes, (RESAMPLES, scenes))
    return np.stack([(drawn == scene).sum(axis=1) for scene in range(scenes)], axis=1).astype(np.float64)


def interval(sums: Float64Array, counts: Float64Array, seed: int) -> tuple[float, ...]:
    """Ends of the interval of a mean, by the sum and the number of each scene's values, one or more; none of one scene."""
    times = draws(len(sums), seed)
    return tuple(np.percentile((times @ sums) / (times @ counts), (2.5, 97.5)).tolist()) if len(sums) > 1 else ()


def yaw_labels(rows: Iterable[Row]) -> dict[tuple[str, str, float | None], list[str]]:
    """(protocol, dataset, yaw) -> the yaws under which a row counts. Whole degrees are an orbit's; else pairs are binned."""
    yaws: dict[tuple[str, str], set[float | None]] = defaultdict(set)
    for row in rows:
        yaws[row.protocol, row.dataset].add(row.yaw)
    return {(*place, yaw): [ALL, *own_labels(yaw, is_orbit(found))] for place, found in yaws.items() for yaw in found}


def yaw_order(label: str) -> tuple[float, str]:
    """Sorts ±10, +10, -10, ±20, ..., all."""
    digits = re.sub(r"[^\d.]", "", label)
    return (float(digits), str("±≈+-".find(label[0]))) if digits else (math.inf, label)


def write_summary(path: Path, summary: Summary) -> None:
    """summary.json: `about`, `methods`, `columns` and one line a mean. Raises OutputError."""
    columns = [*Key._fields, "mean", "low", "high", "frames", "scenes"]
    head = {**summary.about, "methods": list(summary.methods), "columns": columns}
    lines = [
        json.dumps([*key, *map(_number, one[:3]), one.frames, one.scenes], ensure_ascii=False)
        for key, one in summary.means.items()
    ]
    text = json.dumps(head, indent=2, ensure_ascii=False, allow_nan=False).rstrip("}").rstrip()
    body = ",\n    ".join(lines)
    write_file(path, f'{text},\n  "means": [\n    {body}\n  ]\n}}\n')


def is_orbit(yaws: Iterable[float | None]) -> bool:
    """Whether yaws are an orbit's: whole degrees, where there are any."""
    return all(one is None or one == round(one) for one in yaws)


def own_labels(yaw: float | None, orbit: bool) -> list[str]:
    """The names of a yaw: ±10 and its own sign of an orbit, ≈10 of pairs; none of a case without one."""
    if yaw is None:
        return []
    if not orbit:
        return [f"≈{round(abs(yaw) / 10) * 10}"]
    if yaw == 0:
        return ["0"]
    return [f"±{abs(yaw):g}", f"{yaw:+g}"]


def _number(value: float | None) -> float | str | None:
    """10 digits are more than any mean means; what is infinite is written as text."""
    if value is None:
        return None
    return float(f"{value:.10g}") if math.isfinite(value) else str(value)
