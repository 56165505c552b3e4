"""A data set in any known layout in; a job for each of its frames, removals or pairs, out."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dlama.datasets.frames import Case, Frame
from dlama.datasets.layouts import open_dataset
from dlama.errors import InputError
from dlama.evaluation.runner.cache_key import short_hash
from dlama.jobs.job import Job
from dlama.jobs.parameters import METHOD, MOVE, POINTING, RESULTS, check_parameters

TAKEN = (*MOVE, *METHOD, *POINTING, *RESULTS, "right_view", "matcher", "max_disparity")
"""Parameters that jobs of a data set may have; files, cameras and units are the data set's own."""
OF_DATASET = ("camera", "depth_range", "depth_scale")
"""Parameters that say how the data set is read, for the layouts that lack them."""


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
        verb, parameters = self.verb or "", self._parameters()
        reading: Any = {name: self.defaults[name] for name in OF_DATASET if self.defaults.get(name) is not None}
        dataset = open_dataset(self.root, self.layout, **reading)
        items: Sequence[Frame | Case] = dataset.frames
        if verb == "stereo":
            items = dataset.of("sii")
        elif verb == "remove" and not any(name in parameters for name in POINTING):
            items = dataset.of("ori")
        if not items:
            raise InputError(f"{self.root}: the data set (layout {dataset.layout}) has nothing for {verb}")
        for one in items:
            name = job_name(f"{one.scene}/{one.name if isinstance(one, Frame) else one.frame}")
            yield Job(name, verb, parameters, f"{self.root}: {name}", load=one.load, load_hash=short_hash(one.load))

    def _parameters(self) -> dict[str, Any]:
        given = {name: value for name, value in self.defaults.items() if value is not None and name not in OF_DATASET}
        refused = [name for name in given if name not in TAKEN]
        if refused:
            raise InputError(f"`{refused[0]}` does not apply to a data set, which has its own files, cameras and units")
        return check_parameters(self.verb or "", given, loaded=True)


def job_name(item: str) -> str:
    """Of the job, which its folder is called by."""
    return "/".join(re.sub(r"[^\w.+,=@-]", "_", part) for part in item.split("/") if part not in ("", "."))
