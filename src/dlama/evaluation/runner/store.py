"""What one method made of one case <-> one JSON file; many of them <-> results.csv and timings.csv, one row a number.

Files are written whole or not at all. A JSON file that cannot be read counts as absent.
"""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from dlama.datasets.frames import Case
from dlama.evaluation.protocols.methods import Measure, Method
from dlama.files.atomic_write import new_file

LONGEST_NAME = 180
"""Characters of a file's stem; file systems take 255 bytes with suffix and a draft's extra."""


@dataclass(frozen=True)
class StoredRun:
    """One `Scored`: its variant, its numbers, and the file of its panel under DIR/panels."""

    variant: str
    measures: tuple[Measure, ...]
    panel: str | None = None


@dataclass(frozen=True)
class Stored:
    """What one method made of one case."""

    cache_key: str
    """Of everything that the result depends on; see `dlama.evaluation.runner.cache_key`."""
    protocol: str
    dataset: str
    scene: str
    frame: str
    yaw: float | None
    recipe: str
    filler: str
    runs: tuple[StoredRun, ...]
    timings: tuple[Measure, ...]
    """Rows of modality time and memory; they differ from run to run, so they stay out of results.csv."""
    warnings: tuple[str, ...] = ()

    def recipe_of(self, run: StoredRun) -> str:
        """With `+variant` where the run has one."""
        return f"{self.recipe}+{run.variant}" if run.variant else self.recipe


def stem(case: Case, method: Method) -> str:
    """The name, without suffix, of the files of a case and a method; safe on every file system."""
    extra = f"-{_short_hash(repr(sorted(method.changes.items())))}" if method.changes else ""
    name = re.sub(r"[^\w.+,=@-]", "_", f"{case.key}__{method.recipe}-{method.filler}{extra}")
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 9]}-{_short_hash(name)}"


def write_stored(path: Path, stored: Stored) -> None:
    """Raises OutputError."""
    content = dataclasses.asdict(stored)
    for run, raw in zip(stored.runs, content["runs"]):
        raw["measures"] = [_as_row(measure) for measure in run.measures]
    content["timings"] = [_as_row(measure) for measure in stored.timings]
    with new_file(path) as draft:
        draft.write_text(json.dumps(content, allow_nan=False) + "\n", encoding="utf-8")


def read_stored(path: Path) -> Stored | None:
    """None where there is no such file or not all of it is there, as it was written."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        runs = tuple(
            StoredRun(_text(raw["variant"]), tuple(map(_as_measure, raw["measures"])), _file_name(raw["panel"]))
            for raw in content.pop("runs")
        )
        timings, warnings = tuple(map(_as_measure, content.pop("timings"))), tuple(map(_text, content.pop("warnings")))
        yaw = content.pop("yaw")
        if type(yaw) not in (int, float, type(None)):
            raise TypeError(f"yaw is {yaw!r}")
        words = {name: _text(word) for name, word in content.items()}
        return Stored(**words, yaw=yaw, runs=runs, timings=timings, warnings=warnings)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None


def _text(value: Any) -> str:
    """TypeError where it is none."""
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _file_name(value: Any) -> str | None:
    """TypeError, ValueError where it is neither None nor the name of a file."""
    if value is not None and {"/", "\0"} & set(_text(value)):
        raise ValueError(f"{value!r} is no name of a file")
    return value


class Row(NamedTuple):
    """One number. In the CSV file `yaw` is empty where there is none, and a value has all its digits."""

    protocol: str
    dataset: str
    scene: str
    frame: str
    yaw: float | None
    recipe: str
    """With `+variant` where a run has one."""
    filler: str
    region: str
    modality: str
    metric: str
    value: float

    @property
    def method(self) -> str:
        """`recipe/filler`, as tables name it."""
        return f"{self.recipe}/{self.filler}"


def result_rows(stored: Iterable[Stored]) -> list[Row]:
    """The numbers that are the same on every run, in the order in which they were asked for."""
    rows = []
    for one in stored:
        for run in one.runs:
            head = (one.protocol, one.dataset, one.scene, one.frame, one.yaw, one.recipe_of(run), one.filler)
            rows += [Row(*head, *measure) for measure in run.measures]
    return rows


def timing_rows(stored: Iterable[Stored]) -> list[Row]:
    """Runtimes (seconds) and peak memory (MiB): they differ from run to run."""
    return [
        Row(one.protocol, one.dataset, one.scene, one.frame, one.yaw, one.recipe, one.filler, *measure)
        for one in stored
        for measure in one.timings
    ]


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Equal rows give equal bytes. Raises OutputError."""
    with new_file(path) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(Row._fields)
        for row in rows:
            yaw = "" if row.yaw is None else f"{row.yaw:.10g}"
            writer.writerow([*row[:4], yaw, *row[5:10], repr(float(row.value))])


def _as_row(measure: Measure) -> list[Any]:
    """JSON has no infinity (the PSNR of equal pictures): what is not finite is written as text."""
    value = float(measure.value)
    return [*measure[:3], value if abs(value) < float("inf") else str(value)]


def _as_measure(row: list[Any]) -> Measure:
    region, modality, metric, value = row
    return Measure(_text(region), _text(modality), _text(metric), float(value))


def _short_hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]
