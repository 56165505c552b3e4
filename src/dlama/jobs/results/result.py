"""What came of one job: a row of the manifest, as JSON and as CSV."""

from __future__ import annotations

import dataclasses
import json
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from dlama.files.schema import SCHEMA
from dlama.workers.progress import duration

Status = Literal["done", "failed"]


@dataclass(frozen=True)
class JobResult:
    """One job, done or failed. CSV columns are these fields, in this order."""

    id: str
    status: Status
    verb: str = ""
    error_kind: str = ""
    """Name of the error: FileError, DepthError, ..., or WorkerDied."""
    error: str = ""
    """One line; empty: it is done."""
    folder: str = ""
    """Where its files lie below OUT, or their tar shard; empty: it failed."""
    hole_share: float | None = None
    """0..1, mean over its views: what had to be invented."""
    depth_only_share: float | None = None
    """0..1, mean over its views: what lacked only depth."""
    law_moves: int | None = None
    """Filled pixels that were moved behind what was measured."""
    law_violations: int | None = None
    """Filled pixels that still hide what was measured; expected: 0."""
    seconds: float = 0.0
    """Of the whole job, reading and writing too."""
    seconds_by_stage: Mapping[str, float] = field(default_factory=dict)
    peak_mib: float | None = None
    """Largest memory of its process meanwhile."""
    host: str = ""
    attempts: int = 1
    """How often it was begun: 2 where its first process died."""
    finished: float = 0.0
    """Seconds since 1970, UTC."""
    options_hash: str = ""
    inputs: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """Role -> path, sha256, and a stamp (size and time of change) by which an unchanged file is known without reading it."""
    warnings: tuple[str, ...] = ()
    trace: str = ""
    """Of an error that dlama does not know, where it came from."""
    replaces: str = ""
    """The tar shard, or the folder, that holds an earlier result, until this one is packed."""
    kept: bool = False
    """An earlier run had done it."""
    schema: int = SCHEMA
    """Version of these fields, as of meta.json and scene.npz."""

    def as_json(self) -> str:
        """One line."""
        values = {name: value for name, value in dataclasses.asdict(self).items() if name != "kept"}
        return json.dumps(values, allow_nan=False)

    @classmethod
    def from_json(cls, line: str) -> JobResult:
        """Raises ValueError or TypeError: not all of it is there."""
        values = json.loads(line)
        return cls(**{**values, "warnings": tuple(values["warnings"])})

    def csv_row(self) -> list[Any]:
        """Mappings as JSON; of inputs the hashes; what is not known is empty."""
        row = []
        for name in CSV_COLUMNS:
            value = getattr(self, name)
            if name == "inputs":
                value = json.dumps({role: one["sha256"] for role, one in value.items()})
            elif isinstance(value, (Mapping, tuple)):
                value = json.dumps(value)
            row.append("" if value is None else value)
        return row


CSV_COLUMNS = tuple(one.name for one in dataclasses.fields(JobResult) if one.name not in ("trace", "replaces", "kept"))


@dataclass
class Totals:
    """Results of a run, counted; nothing of a single one is kept."""

    done: int = 0
    kept: int = 0
    failed: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    """Failures by the name of their error."""
    seconds: float = 0.0
    """Of all jobs of this run that are done."""
    stages: dict[str, float] = field(default_factory=dict)
    hole_shares: float = 0.0
    law_moves: int = 0
    law_violations: int = 0
    peak_mib: float = 0.0
    started: float = field(default_factory=time.monotonic)

    def add(self, row: JobResult) -> None:
        """Count one."""
        if row.status == "failed":
            self.failed += 1
            self.kinds[row.error_kind] += 1
            return
        self.done += 1
        self.kept += row.kept
        self.hole_shares += row.hole_share or 0.0
        self.law_moves += row.law_moves or 0
        self.law_violations += row.law_violations or 0
        self.peak_mib = max(self.peak_mib, row.peak_mib or 0.0)
        if not row.kept:
            self.seconds += row.seconds
            for stage, seconds in row.seconds_by_stage.items():
                self.stages[stage] = self.stages.get(stage, 0.0) + seconds

    def kinds_line(self) -> str:
        """`2 FileError, 1 DepthError`; empty: nothing failed."""
        return ", ".join(f"{count} {kind}" for kind, count in self.kinds.most_common())

    @property
    def fresh(self) -> int:
        """Results of this run itself."""
        return self.done - self.kept

    def facts(self) -> list[tuple[str, str]]:
        """What is known of the results: names, and texts to read."""
        facts = [("done", f"{self.done}" + (f" ({self.kept} of them by an earlier run)" if self.kept else ""))]
        if self.failed:
            facts.append(("failed", f"{self.failed}: {self.kinds_line()}"))
        if self.fresh:
            stages = ", ".join(f"{name} {seconds / self.fresh:.2f}" for name, seconds in self.stages.items())
            facts.append(("seconds a job", f"{self.seconds / self.fresh:.2f} ({stages})"))
        if self.done:
            facts.append(("unknown before", f"{self.hole_shares / self.done:.1%} of a picture on average"))
            facts.append(("law moves", f"{self.law_moves} pixels moved behind what was measured"))
            facts.append(("law violations", f"{self.law_violations}"))
            facts.append(("peak memory", f"{self.peak_mib:.0f} MiB a worker"))
        return facts

    def lines(self, output: str) -> list[str]:
        """A table to read."""
        wall = time.monotonic() - self.started
        rate = f", {60 * self.fresh / wall:.1f} a minute" if self.fresh and wall else ""
        rows = [*self.facts(), ("time", f"{duration(wall)}{rate}"), ("rows", f"{output}/manifest.csv")]
        return [f"{output}:", *(f"  {name:<15} {value}" for name, value in rows)]

    def values(self, output: str) -> dict[str, Any]:
        """The same, JSON-ready."""
        counts = {"done": self.done, "kept": self.kept, "failed": self.failed, "failures": self.kinds}
        return {"output": output, "manifest": f"{output}/manifest.csv", **counts, "law_violations": self.law_violations}
