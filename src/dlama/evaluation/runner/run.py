"""A data set and methods in; every case x method run, stored and resumed, failures listed; all that is stored out.

Where single processes die, the other tasks continue.
"""

from __future__ import annotations

import itertools
import json
import shutil
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dlama.datasets.frames import Case, Protocol, Truth
from dlama.errors import InputError
from dlama.evaluation.protocols.methods import Measure, Method, ProtocolSettings, Score, Scored
from dlama.evaluation.protocols.strips import jpeg
from dlama.evaluation.runner.cache_key import cache_key, case_hash, method_hash
from dlama.evaluation.runner.store import Row, Stored, read_stored, stem, write_stored
from dlama.files.rasters.depth import write_depth_exr
from dlama.files.rasters.pictures import write_color
from dlama.workers.memory import check_processes, peak_mib, reset_peak
from dlama.workers.pool import run_all
from dlama.writing.atomic_write import write_file, writing
from dlama.writing.drafts import remove_abandoned

PICTURES = "pictures"
TIMED = ("time", "memory")
"""Modalities that differ from run to run."""
FOLDERS = ("cases", "panels", PICTURES)
"""Below the folder of results."""
DIED = "a process died twice while it ran this case (out of memory?); fewer --jobs may help"


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


def run_tasks(tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """Of every task. When a process dies, the case it had runs again; one that ends its process again fails."""
    if jobs == 1 or len(tasks) <= 1:
        yield from itertools.chain.from_iterable(map(work, tasks))
        return
    try:
        for ended in run_all(work_all, tasks, min(jobs, len(tasks))):
            if ended.died:
                yield from (Outcome(ended.task.case, method, DIED) for method, _ in ended.task.methods)
            else:
                yield from ended.answer
    except BaseException:  # Ctrl-C: files are written whole or not at all, so nobody has to be waited for
        for folder in {task.folder / name for task in tasks for name in FOLDERS}:
            remove_abandoned(folder, again=True)
        raise


Progress = Callable[[Outcome | None, int, int], None]
"""Called with what has just ended (None: kept from an earlier run), and how many of how many are done."""


@dataclass(frozen=True)
class Results:
    """Everything that one evaluation asked for."""

    stored: tuple[Stored, ...]
    """What went well, cases in the data set's order, methods in the given order within each."""
    failures: tuple[Outcome, ...]
    reused: int
    """How many of them an earlier run had left."""
    stale: int = 0
    """How many it had left that were done again: settings, data, network or dlama had changed."""


def run(
    cases: Sequence[Case],
    methods: Sequence[Method],
    protocols: Mapping[Protocol, Score],
    settings: ProtocolSettings,
    folder: Path,
    *,
    jobs: int = 1,
    pictures: bool = False,
    progress: Progress | None = None,
) -> Results:
    """Run every method on every case, and keep what `folder` already holds under the same cache key.

    Args:
        protocols: name of a protocol -> what runs it.
        settings: handed to the protocol, and part of the cache key. Picklable.
        folder: made if need be; cases/, panels/, errors/ and errors.json lie there afterwards.
        jobs: processes; each computes on one core where there are several.
        pictures: keep each completed picture and its depth in pictures/; what was stored without is done again.
    Raises:
        InputError: two cases of the same name, nothing to run, jobs below 1 or more than the computer can hold.
        OutputError: the folder cannot be written.
    """
    _check(cases, methods, jobs)
    with writing(folder):
        for name in FOLDERS if pictures else FOLDERS[:2]:
            (folder / name).mkdir(parents=True, exist_ok=True)
    tasks, reused, stale = _plan(cases, methods, protocols, settings, folder, pictures)
    report = progress or (lambda *_: None)
    total, done = len(cases) * len(methods), reused
    report(None, done, total)
    failed: dict[str, Outcome] = {}
    for outcome in run_tasks(tasks, jobs):
        done += 1
        if outcome.error:
            failed[stem(outcome.case, outcome.method)] = outcome
        report(outcome, done, total)
    names = [stem(case, method) for case in cases for method in methods]
    failures = tuple(failed[name] for name in names if name in failed)
    write_errors(folder, failures)
    stored = [read_stored(folder / "cases" / f"{name}.json") for name in names if name not in failed]
    return Results(tuple(one for one in stored if one is not None), failures, reused, stale)


def write_errors(folder: Path, failures: Sequence[Outcome]) -> None:
    """errors.json and a traceback each in errors/; where nothing failed, both are removed. Raises OutputError."""
    shutil.rmtree(folder / "errors", ignore_errors=True)
    (folder / "errors.json").unlink(missing_ok=True)
    if not failures:
        return
    (folder / "errors").mkdir()
    entries = []
    for one in failures:
        place = f"errors/{stem(one.case, one.method)}.txt"
        write_file(folder / place, one.trace or f"{one.error}\n")
        names = {"protocol": one.case.protocol, "scene": one.case.scene, "frame": one.case.frame}
        entries.append({**names, "method": one.method.label, "error": one.error, "traceback": place})
    write_file(folder / "errors.json", json.dumps(entries, indent=2, ensure_ascii=False) + "\n")


def _check(cases: Sequence[Case], methods: Sequence[Method], jobs: int) -> None:
    check_processes(jobs, "jobs")
    if not cases or not methods:
        raise InputError(f"{len(cases)} cases and {len(methods)} methods leave nothing to evaluate")
    for kind, names in (("cases", [case.key for case in cases]), ("methods", [method.label for method in methods])):
        twice = sorted(name for name, count in Counter(names).items() if count > 1)
        if twice:
            raise InputError(f"two {kind} are called {twice[0]}; every one needs a name of its own")


def _plan(
    cases: Sequence[Case],
    methods: Sequence[Method],
    protocols: Mapping[Protocol, Score],
    settings: ProtocolSettings,
    folder: Path,
    pictures: bool,
) -> tuple[list[Task], int, int]:
    """What has still to be run, how many results are kept, and how many are there under another cache key."""
    method_hashes = {method.label: method_hash(method) for method in methods}
    tasks, reused, stale = [], 0, 0
    for case in cases:
        hashed = case_hash(case)
        todo = []
        for method in methods:
            key = cache_key(hashed, method_hashes[method.label], settings, protocols[case.protocol])
            found = read_stored(folder / "cases" / f"{stem(case, method)}.json")
            files = [] if found is None else [folder / "panels" / file for file in found.panels.values()]
            files += [picture_of(folder, stem(case, method))] if pictures else []
            if found is not None and found.cache_key == key and all(file.is_file() for file in files):
                reused += 1
            else:
                todo.append((method, key))
                stale += found is not None and found.cache_key != key
        if todo:
            tasks.append(Task(case, tuple(todo), protocols[case.protocol], settings, folder, pictures))
    return tasks, reused, stale


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
    shown = picture_of(task.folder, name)
    deep = shown.with_suffix(".exr")
    for old in (shown, deep):  # of earlier settings or code
        old.unlink(missing_ok=True)
    rows, panels = list[Row](), dict[str, str]()
    for number, one in enumerate(scored):
        recipe = f"{method.recipe}+{one.variant}" if one.variant else method.recipe
        rows += [Row(*head, recipe, method.filler, *each) for each in one.measures if each.modality not in TIMED]
        if one.panel is not None:
            panels[recipe] = f"{name}--{number}.jpg"
            write_file(task.folder / "panels" / panels[recipe], jpeg(one.panel))
        if task.pictures and one.view is not None:
            write_depth_exr(deep, one.view.depth)
            write_color(shown, one.view.color)
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
