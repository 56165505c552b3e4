"""Stored results in; results.csv and timings.csv, one row a number, out; and back."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from dlama.errors import FileError
from dlama.evaluation.runner.store import Stored
from dlama.files.atomic_write import new_file


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


HEADER = ",".join(Row._fields)


def result_rows(stored: Iterable[Stored]) -> list[Row]:
    """The numbers that are the same on every run, in the order in which they were asked for."""
    rows = []
    for one in stored:
        for run in one.runs:
            recipe = f"{one.recipe}+{run.variant}" if run.variant else one.recipe
            head = (one.protocol, one.dataset, one.scene, one.frame, one.yaw, recipe, one.filler)
            rows += [Row(*head, *measure) for measure in run.measures]
    return rows


def timing_rows(stored: Iterable[Stored]) -> list[Row]:
    """Runtime and peak memory: of the machine and the day."""
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


def read_rows(path: Path) -> list[Row]:
    """Raises FileError, which names the line."""
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            lines = list(csv.reader(stream))
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot be read as a table: {error}") from error
    if not lines or tuple(lines[0]) != Row._fields:
        raise FileError(f"{path}: line 1 is {','.join(lines[0]) if lines else 'missing'}; {HEADER} is wanted")
    return [_row(path, number, line) for number, line in enumerate(lines[1:], 2)]


def _row(path: Path, number: int, line: list[str]) -> Row:
    try:
        protocol, dataset, scene, frame, yaw, recipe, filler, region, modality, metric, value = line
        numbers = float(yaw) if yaw else None, float(value)
    except ValueError as error:
        raise FileError(
            f"{path}: line {number} is no row of {len(Row._fields)} fields with numbers: {error}"
        ) from error
    return Row(protocol, dataset, scene, frame, numbers[0], recipe, filler, region, modality, metric, numbers[1])
