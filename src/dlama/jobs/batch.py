"""A list of jobs in; every job run, on processes of this computer or of many, and its result, as soon as it is there, out."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any, Protocol

from dlama.completion.memory import available_bytes, processor_count
from dlama.errors import InputError, MissingExtraError, OutputError
from dlama.files.atomic_write import PathLike
from dlama.files.drafts import remove_abandoned
from dlama.jobs.job import Job, job_of
from dlama.jobs.lists.tables import rows as rows_of
from dlama.jobs.manifest import Manifest
from dlama.jobs.parameters import KNOWN, VERBS
from dlama.jobs.perform import Task, given_up, work
from dlama.jobs.result import JobResult
from dlama.jobs.storage import Output, folder_of, is_address, local
from dlama.workers.memory import PROCESS_BYTES, check_count
from dlama.workers.pool import TRIES, Ended, Pool

Progress = Callable[[JobResult | None, int, int | None], object]
"""Called with what has just ended (None: at the start), and how many of how many are done; None: it is not known."""
Source = PathLike | Iterable[Mapping[str, Any]]
WINDOW = 8
"""Results a worker that may wait for an earlier one, where they are wanted in order."""
AT_ONCE = 64
"""Rows that are looked at before results are handed out."""
UNWRITTEN = 4
"""Results, one after the other, that could not be written, after which a run ends: a full disk."""


class Workers(Protocol):
    """What runs tasks: `dlama.workers.pool.Pool`, or the actors of a Ray cluster."""

    count: int

    @property
    def free(self) -> int:
        """How many tasks can be handed in now."""

    def submit(self, task: Task) -> None:
        """Hand in one."""

    def wait(self) -> list[Ended]:
        """What has ended; waits for at least one."""

    def close(self) -> None:
        """End all workers."""


def batch(
    jobs: Source,
    out: PathLike,
    *,
    verb: str | None = None,
    workers: int | None = None,
    threads: int | None = None,
    ordered: bool = False,
    resume: bool = True,
    stop_after_failures: int | None = None,
    ray: str | None = None,
    gpus_per_worker: float = 0.0,
    progress: Progress | None = None,
    **defaults: Any,
) -> Iterator[JobResult]:
    """Run every job of a list and yield its result as it ends; a job that an earlier run did from the same inputs is kept.

    Results lie in OUT/ID/, each whole or not there. OUT/manifest.csv has one row a job at the end. A bad input, or a job that
    ends its process twice, is one failed row; all others are run.

    Args:
        jobs: a CSV, JSONL or Parquet file with `id`, `verb` (view, remove, stereo or depth) and the verb's parameters, named as
            on the command line, relative paths from its folder; or such rows as mappings.
        out: a directory, or an address that fsspec knows (s3://...).
        verb: of rows without one.
        workers: processes; default: the cores of this computer, as far as memory allows.
        threads: of each process; default: the cores shared between them.
        ordered: results come in the order of the list; default: as they end.
        resume: False: every job is run again.
        stop_after_failures: no new job is begun after so many failures of this run.
        ray: run on a Ray cluster: local, auto, or HOST:PORT; all its nodes must see the inputs and `out` under the same names.
        gpus_per_worker: on a cluster, the share of a GPU that each worker is given.
        progress: called as results come.
        defaults: parameters of all jobs whose verb takes them (fov=65, filler="migan").

    Raises:
        InputError: a list that cannot be read, two jobs of the same id, an unknown parameter; before anything is run where the
            list can be read twice.
        OutputError: OUT cannot be written, or another run is writing there.
        MissingExtraError: a cluster, an address or Parquet, and the package for it is not installed.
    """
    source = JobList(jobs, verb, checked_defaults(verb, defaults))
    if stop_after_failures is not None and stop_after_failures < 1:
        raise InputError(f"stop_after_failures is {stop_after_failures}; 1 or more is wanted")
    output = Output(str(out) if is_address(str(out)) else str(Path(local(str(out))).absolute()))
    settings = Settings(output, ordered, resume, stop_after_failures, progress or (lambda *_: None))
    return _run(source, settings, starter(workers, threads, ray, gpus_per_worker))


@dataclass(frozen=True)
class Settings:
    """How a run goes."""

    output: Output
    ordered: bool = False
    resume: bool = True
    stop_after_failures: int | None = None
    progress: Progress = lambda *_: None


@dataclass(frozen=True)
class JobList:
    """A list file, or rows; iterated over, its jobs."""

    jobs: Source
    verb: str | None = None
    defaults: Mapping[str, Any] = field(default_factory=dict)

    @property
    def can_be_read_twice(self) -> bool:
        """Files can, and whatever does not use itself up."""
        return self._file is not None or iter(self.jobs) is not self.jobs  # type: ignore[arg-type]

    @property
    def _file(self) -> str | None:
        return str(self.jobs) if isinstance(self.jobs, (str, Path)) or hasattr(self.jobs, "__fspath__") else None

    def __iter__(self) -> Iterator[Job]:
        """Raises InputError for a list that is none, or an id that cannot be."""
        if self._file is not None:
            base = folder_of(self._file)
            for where, row in rows_of(self._file):
                yield job_of(row, self.defaults, base, where, self.verb)
            return
        rows: Any = self.jobs
        for number, one in enumerate(rows, 1):
            if isinstance(one, Job):
                yield one
            else:
                yield job_of(one, self.defaults, str(Path.cwd()), f"job {number}", self.verb)


def checked_defaults(verb: str | None, defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Those that are given (not None). InputError: an unknown verb, or a parameter that no verb has."""
    if verb is not None and verb not in VERBS:
        raise InputError(f"verb is {verb!r}; one of {', '.join(VERBS)} is wanted")
    for name in defaults:
        if name not in KNOWN:
            raise InputError(f"{name} is no parameter of a verb; known are {', '.join(KNOWN)}")
    given = {name: value for name, value in defaults.items() if value is not None}
    return {name: str(Path(value).absolute()) if isinstance(value, Path) else value for name, value in given.items()}


def starter(workers: int | None, threads: int | None, ray: str | None, gpus_per_worker: float) -> Callable[[], Workers]:
    """What starts the workers. InputError: numbers that cannot be. MissingExtraError: Ray is not installed."""
    if ray is None:
        if gpus_per_worker:
            raise InputError(f"gpus_per_worker is {gpus_per_worker} without ray; it is for clusters")
        chosen = workers_for(workers, threads)
        return lambda: Pool(work, *chosen)
    for name, value in (("workers", workers), ("threads", threads)):
        if value is not None and value < 1:
            raise InputError(f"{name} is {value}; 1 or more is wanted")
    if gpus_per_worker < 0:
        raise InputError(f"gpus_per_worker is {gpus_per_worker}; 0 or more is wanted")
    if find_spec("ray") is None:
        raise MissingExtraError(f"ray={ray}", "ray", "batch")
    from dlama.jobs.on_ray import RayWorkers

    return lambda: RayWorkers(work, ray, workers, threads, gpus_per_worker)


def workers_for(workers: int | None, threads: int | None) -> tuple[int, int]:
    """Processes and threads of each. InputError: below 1, or more than this computer holds."""
    cores, free = processor_count(), available_bytes()
    if workers is not None:
        check_count(workers, "workers")
    if threads is not None and not 1 <= threads <= max(cores, 2):
        raise InputError(f"threads is {threads}; 1 to {cores}, as many as this computer has cores, is wanted")
    fitting = cores if free is None else max(1, min(cores, int(free / PROCESS_BYTES)))
    count = workers or max(1, fitting // (threads or 1))
    return count, threads or max(1, cores // count)


def first_jobs(source: JobList, count: int = 10) -> list[Job]:
    """The first jobs of a list."""
    return list(islice(iter(source), count))


def _run(source: JobList, settings: Settings, start: Callable[[], Workers]) -> Iterator[JobResult]:
    _remove_drafts(settings.output)
    with Manifest(settings.output) as manifest:
        total = None
        if source.can_be_read_twice:
            for number, job in enumerate(source):
                manifest.plan(number, job.id, job.where)
            total = manifest.planned
        workers = start()
        try:
            yield from _Run(source, settings, manifest, workers, total).results()
        except BaseException:
            with suppress(OutputError):
                manifest.write_table()
            raise
        finally:
            workers.close()
            _remove_drafts(settings.output)  # also those of workers that ended a moment after their killed driver
        manifest.write_table()


def _remove_drafts(output: Output) -> None:
    """What processes that have ended left half-made."""
    if not output.is_remote:
        remove_abandoned(Path(local(output.place)).absolute(), again=True)


@dataclass
class _Run:
    """One run under way."""

    source: JobList
    settings: Settings
    manifest: Manifest
    workers: Workers
    total: int | None
    begun: int = 0
    """Jobs taken from the list."""
    handed_out: int = 0
    failures: int = 0
    unwritten: int = 0
    under_way: int = 0
    again: deque[Task] = field(default_factory=deque)
    """Tasks whose process died."""
    ready: list[tuple[int, JobResult]] = field(default_factory=list)
    """Results not yet handed out, a heap by number where they are wanted in order."""

    def results(self) -> Iterator[JobResult]:
        """All of them."""
        self.settings.progress(None, 0, self.total)
        jobs = iter(self.source)
        more = True
        while more or self.under_way or self.again:
            while self.workers.free and len(self.ready) < AT_ONCE:
                task = self.again.popleft() if self.again else None
                if task is None and more and not self.is_full():
                    task, more = self.next_task(jobs)
                if task is None:
                    break
                self.workers.submit(task)
                self.under_way += 1
            yield from self.handed()
            can_begin = self.again or (more and not self.is_full())
            if (more or self.again or self.under_way) and not (can_begin and self.workers.free):
                for ended in self.workers.wait():
                    self.under_way -= 1
                    self.end(ended)
                yield from self.handed()
        yield from self.handed()

    def is_full(self) -> bool:
        """Whether too many results wait for an earlier one."""
        return self.settings.ordered and self.begun - self.handed_out >= WINDOW * self.workers.count

    def next_task(self, jobs: Iterator[Job]) -> tuple[Task | None, bool]:
        """The next job that is to be run, None: none of the next few is; and whether the list may have more."""
        limit = self.settings.stop_after_failures
        for _ in range(AT_ONCE):
            if limit is not None and self.failures >= limit:
                return None, False
            job = next(jobs, None)
            if job is None:
                return None, False
            number, self.begun = self.begun, self.begun + 1
            if self.total is None:
                self.manifest.plan(number, job.id, job.where)
            kept = self.manifest.kept(job) if self.settings.resume and not job.error else None
            if kept is not None:
                self.add(number, kept)
            elif job.error:
                self.add(number, work(Task(job, self.settings.output)))
            else:
                return Task(job, self.settings.output, number=number), True
            if self.is_full():
                break
        return None, True

    def end(self, ended: Ended) -> None:
        """A task has ended, or its process has."""
        task: Task = ended.task
        if ended.died is None:
            self.add(task.number, ended.answer)
        elif ended.blameless:
            self.again.append(task)
        elif task.attempt < TRIES:
            self.again.append(replace(task, attempt=task.attempt + 1))
        else:
            self.add(task.number, given_up(task.job, ended.died, task.attempt))

    def add(self, number: int, row: JobResult) -> None:
        """Enter a result; OutputError where nothing can be written any more."""
        if not row.kept:
            self.manifest.add(row)
        self.failures += row.status == "failed"
        self.unwritten = self.unwritten + 1 if row.error_kind == "OutputError" else 0
        heapq.heappush(self.ready, (number, row)) if self.settings.ordered else self.ready.append((number, row))
        if self.unwritten >= UNWRITTEN:
            raise OutputError(
                f"the last {UNWRITTEN} results could not be written ({row.error}); what is done is kept, and the same command "
                "goes on from there"
            )

    def handed(self) -> Iterator[JobResult]:
        """The results that can be handed out now."""
        while self.ready and (not self.settings.ordered or self.ready[0][0] == self.handed_out):
            _, row = heapq.heappop(self.ready) if self.settings.ordered else self.ready.pop(0)
            self.handed_out += 1
            self.settings.progress(row, self.handed_out, self.total)
            yield row
