"""One case and several methods in; each method's numbers and panel stored, or its failure, out. Runs in any process."""

from __future__ import annotations

import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dlama.datasets.frames import Case, Truth
from dlama.evaluation.protocols.methods import Measure, Method, ProtocolSettings, Score, Scored
from dlama.evaluation.protocols.strips import jpeg
from dlama.evaluation.runner.store import Row, Stored, stem, write_stored
from dlama.files.rasters.depth import write_depth_exr
from dlama.files.rasters.pictures import write_color
from dlama.workers.memory import peak_mib, reset_peak
from dlama.writing.atomic_write import write_file

PICTURES = "pictures"
TIMED = ("time", "memory")
"""Modalities that differ from run to run."""


@dataclass(frozen=True)
class Task:
    """A case, and the methods that have still to run on it."""

    case: Case
    methods: tuple[tuple[Method, str], ...]
    """Each with the cache key that its result will carry."""
    protocol: Score
    settings: ProtocolSettings
    folder: Path
    pictures: bool = False
    """Whether completed pictures are kept in folder/PICTURES."""


@dataclass(frozen=True)
class Outcome:
    """Whether one method ran on one case."""

    case: Case
    method: Method
    error: str | None = None
    """One line; None: all went well."""
    trace: str = ""


def work(task: Task) -> Iterator[Outcome]:
    """Run and store every method of a task, one after the other; a failure is reported and does not stop the rest."""
    try:
        truth = task.case.load()
    except Exception as error:  # any error of a bad frame
        yield from (_failure(task.case, method, error) for method, _ in task.methods)
        return
    for method, key in task.methods:
        try:
            _run_one(task, truth, method, key)
            yield Outcome(task.case, method)
        except Exception as error:
            yield _failure(task.case, method, error)


def work_all(task: Task) -> list[Outcome]:
    """`work` for another process, which sends all outcomes of a task at once."""
    return list(work(task))


def _run_one(task: Task, truth: Truth, method: Method, key: str) -> None:
    since_reset, started = reset_peak(), time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        scored = task.protocol(truth, method, task.settings)
    seconds, peak = time.perf_counter() - started, peak_mib(since_reset)
    name, case = stem(task.case, method), task.case
    head = case.protocol, case.dataset, case.scene, case.frame, case.yaw
    rows, panels = list[Row](), dict[str, str]()
    for number, one in enumerate(scored):
        recipe = f"{method.recipe}+{one.variant}" if one.variant else method.recipe
        rows += [Row(*head, recipe, method.filler, *each) for each in one.measures if each.modality not in TIMED]
        if one.panel is not None:
            panels[recipe] = f"{name}--{number}.jpg"
            write_file(task.folder / "panels" / panels[recipe], jpeg(one.panel))
        if task.pictures and one.view is not None:
            write_depth_exr(task.folder / PICTURES / f"{name}.exr", one.view.depth)
            write_color(picture_of(task.folder, name), one.view.color)
    timings = (Row(*head, method.recipe, method.filler, *each) for each in _timings(scored, seconds, peak))
    warned = dict.fromkeys(str(one.message) for one in caught)
    stored = Stored(key, tuple(rows), tuple(timings), panels, tuple(warned))
    write_stored(task.folder / "cases" / f"{name}.json", stored)


def picture_of(folder: Path, name: str) -> Path:
    """The completed picture of a case and a method, by their stem; its depth is written next to it before."""
    return folder / PICTURES / f"{name}.png"


def _timings(scored: Sequence[Scored], seconds: float, peak: float | None) -> Iterator[Measure]:
    """What the first run took by itself; `seconds_scored`: with the metrics and the variants; `peak_mib`: of the whole process
    meanwhile, metrics included."""
    yield from (one for one in scored[0].measures if one.modality in TIMED)
    yield Measure("whole", "time", "seconds_scored", seconds)
    if peak is not None:
        yield Measure("whole", "memory", "peak_mib", peak)


def _failure(case: Case, method: Method, error: Exception) -> Outcome:
    line = " ".join(f"{type(error).__name__}: {error}".split())
    return Outcome(case, method, line, "".join(traceback.format_exception(error)))
