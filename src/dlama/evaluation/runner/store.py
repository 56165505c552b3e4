"""What one method made of one case <-> one small JSON file: written whole or not at all, unreadable ones count as absent."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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

    fingerprint: str
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
    """None where there is no such file or not all of it is there."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        runs = tuple(
            StoredRun(raw["variant"], tuple(map(_as_measure, raw["measures"])), raw["panel"]) for raw in content["runs"]
        )
        timings = tuple(map(_as_measure, content["timings"]))
        return Stored(**{**content, "runs": runs, "timings": timings, "warnings": tuple(content["warnings"])})
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _as_row(measure: Measure) -> list[Any]:
    """JSON has no infinity (the PSNR of equal pictures): what is not finite is written as text."""
    value = float(measure.value)
    return [*measure[:3], value if abs(value) < float("inf") else str(value)]


def _as_measure(row: list[Any]) -> Measure:
    region, modality, metric, value = row
    return Measure(region, modality, metric, float(value))


def _short_hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]
