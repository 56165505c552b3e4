"""A data set in any known layout in; a job for each of its frames, removals or pairs, out."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dlama.datasets.layouts import open_dataset
from dlama.errors import InputError
from dlama.evaluation.runner.cache_key import short_hash
from dlama.jobs.job import Job
from dlama.jobs.parameters import METHOD, MOVE, POINTING, RESULTS, check_parameters

TAKEN = (*MOVE, *METHOD, *POINTING, *RESULTS, "right_view", "matcher", "max_disparity")
"""Parameters that jobs of a data set may have; files, cameras and units are the data set's own."""


@dataclass(frozen=True)
class DatasetJobs:
    """A data set; iterated over, its jobs. `view` and `depth` take its frames, `remove` its removals, or its frames where
    something is pointed at, `stereo` its pairs."""

    root: Path
    verb: str | None = None
    layout: str | None = None
    defaults: Mapping[str, Any] = field(default_factory=dict)

    def __iter__(self) -> Iterator[Job]:
        """InputError: an unknown layout, a data set without what the verb takes, options that cannot be."""
        verb = self.verb or ""
        refused = [name for name, value in self.defaults.items() if name not in TAKEN and value is not None]
        if refused:
            raise InputError(f"`{refused[0]}` does not apply to a data set, which has its own files, cameras and units")
        given = {name: value for name, value in self.defaults.items() if value is not None}
        parameters = check_parameters(verb, given, loaded=True)
        dataset = open_dataset(self.root, self.layout)
        found: dict[str, Any] = {"stereo": dataset.of("sii")}
        pointed = any(name in parameters for name in POINTING)
        found["remove"] = dataset.frames if pointed else dataset.of("ori")
        items = found.get(verb, dataset.frames)
        if not items:
            raise InputError(f"{self.root}: the data set (layout {dataset.layout}) has nothing for {verb}")
        for one in items:
            name = job_name(f"{one.scene}/{getattr(one, 'name', None) or one.frame}")
            yield Job(name, verb, parameters, f"{self.root}: {name}", load=one.load, load_hash=short_hash(one.load))


def job_name(item: str) -> str:
    """Of the job, which its folder is called by."""
    return "/".join(re.sub(r"[^\w.+,=@-]", "_", part) for part in item.split("/") if part not in ("", "."))
