"""A data set and methods in; every case x method run, stored and resumed, failures listed; all that is stored out.

Where single processes die, the other tasks continue.
"""

from __future__ import annotations

import itertools
import json
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dlama.datasets.frames import Case, Protocol
from dlama.errors import InputError
from dlama.evaluation.protocols.methods import Method, ProtocolSettings, Score
from dlama.evaluation.runner.cache_key import cache_key, case_hash, method_hash
from dlama.evaluation.runner.store import Stored, read_stored, stem
from dlama.evaluation.runner.worker import PICTURES, Outcome, Task, picture_of, work, work_all
from dlama.workers.memory import check_processes
from dlama.workers.pool import run_all
from dlama.writing.atomic_write import write_file, writing
from dlama.writing.drafts import remove_abandoned

FOLDERS = ("cases", "panels", PICTURES)
"""Below the folder of results."""
DIED = "a process died twice while it ran this case (out of memory?); fewer --jobs may help"


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
            shown = not pictures or picture_of(folder, stem(case, method)).is_file()
            if found is not None and found.cache_key == key and _has_panels(folder, found) and shown:
                reused += 1
            else:
                todo.append((method, key))
                stale += found is not None and found.cache_key != key
        if todo:
            tasks.append(Task(case, tuple(todo), protocols[case.protocol], settings, folder, pictures))
    return tasks, reused, stale


def _has_panels(folder: Path, found: Stored) -> bool:
    return all((folder / "panels" / file).is_file() for file in found.panels.values())
