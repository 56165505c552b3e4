"""What one method made of one case <-> one JSON file; many of them <-> results.csv and timings.csv, one row a number.

Files are written whole or not at all. A JSON file that cannot be read counts as absent.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from dlama.datasets.frames import Case
from dlama.evaluation.protocols.methods import Method
from dlama.evaluation.runner.cache_key import short_hash
from dlama.writing.atomic_write import new_file, write_file

LONGEST_NAME = 180
"""Bytes of a file's stem; file systems take 255 bytes with suffix and a draft's extra."""


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


@dataclass(frozen=True)
class Stored:
    """What one method made of one case."""

    cache_key: str
    """Of everything that the result depends on; see `dlama.evaluation.runner.cache_key`."""
    rows: tuple[Row, ...]
    """The numbers that are the same on every run, of the run itself and its variants."""
    timings: tuple[Row, ...]
    """Runtimes (seconds) and peak memory (MiB): they differ from run to run, so they stay out of results.csv."""
    panels: Mapping[str, str]
    """Recipe, with `+variant` where a run has one -> file of its panel under DIR/panels."""
    warnings: tuple[str, ...] = ()


def stem(case: Case, method: Method) -> str:
    """The name, without suffix, of the files of a case and a method; safe on every file system, and of no two cases the same."""
    full = f"{case.key}__{method.recipe}-{method.filler}"
    name = re.sub(r"[^\w.+,=@-]", "_", full, flags=re.ASCII)
    return name if name == full and len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 9]}-{short_hash(full)[:8]}"


def write_stored(path: Path, stored: Stored) -> None:
    """Raises OutputError."""
    content = vars(stored) | {name: [_as_json(row) for row in getattr(stored, name)] for name in ("rows", "timings")}
    write_file(path, json.dumps(content, allow_nan=False) + "\n")


def read_stored(path: Path) -> Stored | None:
    """None where there is no such file or not all of it is there, as it was written."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        rows, timings = (tuple(map(_as_row, content[name])) for name in ("rows", "timings"))
        panels = {_text(recipe): _file_name(file) for recipe, file in content["panels"].items()}
        key, warnings = _text(content["cache_key"]), tuple(map(_text, content["warnings"]))
        return Stored(key, rows, timings, panels, warnings)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None


def _text(value: Any) -> str:
    """TypeError where it is none."""
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _file_name(value: Any) -> str:
    """TypeError, ValueError where it is not the name of a file."""
    if {"/", "\0"} & set(_text(value)):
        raise ValueError(f"{value!r} is no name of a file")
    return str(value)


def _as_json(row: Row) -> list[Any]:
    """JSON has no infinity (the PSNR of equal pictures): what is not finite is written as text."""
    value = float(row.value)
    return [*row[:-1], value if abs(value) < float("inf") else str(value)]


def _as_row(fields: list[Any]) -> Row:
    row = Row(*fields)
    if type(row.yaw) not in (int, float, type(None)):
        raise TypeError(f"yaw is {row.yaw!r}")
    for word in (*row[:4], *row[5:-1]):
        _text(word)
    return row._replace(value=float(row.value))


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Equal rows give equal bytes. Raises OutputError."""
    with new_file(path) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(Row._fields)
        for row in rows:
            yaw = "" if row.yaw is None else f"{row.yaw:.10g}"
            writer.writerow([*row[:4], yaw, *row[5:10], repr(float(row.value))])
