"""Jobs, where their results go, and workers in; every job run, its row entered, and its result, as soon as it is there, out."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from dlama.errors import OutputError
from dlama.jobs.job import Job
from dlama.jobs.on_ray import RayWorkers
from dlama.jobs.perform import Task, died_row, work
from dlama.jobs.results.manifest import Manifest
from dlama.jobs.results.result import JobResult
from dlama.jobs.results.tar_shards import STAGED, Packer, is_shard
from dlama.jobs.storage import Output, local_path
from dlama.workers.pool import TRIES, Pool, TaskEnd
from dlama.writing.drafts import remove_abandoned

JobProgress = Callable[[JobResult | None, int, int | None], object]
"""Called with what has just ended (None: at the start), and how many of how many are done; None: it is not known."""
WINDOW = 8
"""Jobs a worker that may be begun before the result of the first of them is handed out, where results come in order."""
AT_ONCE = 64
"""Results, of jobs that need not be run, that wait before they are handed out."""
UNWRITTEN = 4
"""Results, one after the other, that could not be written, after which a run ends: a full disk."""
Workers = Pool | RayWorkers
"""What runs tasks: processes of this computer, or the actors of a Ray cluster."""


@dataclass(frozen=True)
class Settings:
    """How a run goes."""

    output: Output
    ordered: bool = False
    resume: bool = True
    stop_after_failures: int | None = None
    pack: int | None = None
    progress: JobProgress = lambda *_: None


def run_jobs(
    source: Iterable[Job], can_be_read_twice: bool, settings: Settings, start: Callable[[], Workers]
) -> Iterator[JobResult]:
    """Every job's result. InputError: two of one id, before anything runs where the jobs can be read twice. OutputError."""
    _remove_drafts(settings.output)
    with Manifest(settings.output, source if can_be_read_twice else ()) as manifest:
        total = manifest.planned if can_be_read_twice else None
        packer = Packer(settings.output, manifest, settings.pack)
        workers = start()
        try:
            yield from _Run(iter(source), settings, manifest, packer, workers, total).results()
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
        remove_abandoned(Path(local_path(output.place)).absolute(), again=True)


@dataclass
class _Run:
    """One run under way."""

    jobs: Iterator[Job]
    """Those that are not begun."""
    settings: Settings
    manifest: Manifest
    packer: Packer
    workers: Workers
    total: int | None
    more: bool = True
    """Whether the list may have more jobs."""
    begun: int = 0
    """Jobs taken from the list."""
    handed_out: int = 0
    failures: int = 0
    unwritten: int = 0
    under_way: int = 0
    again: deque[Task] = field(default_factory=deque)
    """Tasks whose process died."""
    ready: dict[int, JobResult] = field(default_factory=dict)
    """Place in the list -> result, of those not yet handed out, as they ended."""

    def results(self) -> Iterator[JobResult]:
        """All of them."""
        self.settings.progress(None, 0, self.total)
        while self.is_going():
            self.hand_in()
            yield from self.ready_results()
            if self.is_going() and not (self.can_begin() and self.workers.free):
                for ended in self.workers.wait():
                    self.under_way -= 1
                    self.end(ended)
                yield from self.ready_results()
        self.packer.pack()

    def is_going(self) -> bool:
        """Whether a job is left, or has not ended."""
        return self.more or bool(self.again) or self.under_way > 0

    def can_begin(self) -> bool:
        """Whether a free worker may be given a task. Where results come in order, few of them wait for an earlier one."""
        full = self.settings.ordered and self.begun - self.handed_out >= WINDOW * self.workers.count
        return bool(self.again) or (self.more and not full)

    def hand_in(self) -> None:
        """Give free workers their tasks."""
        while self.workers.free and self.can_begin() and (self.settings.ordered or len(self.ready) < AT_ONCE):
            task = self.again.popleft() if self.again else self.next_task()
            if task is not None:
                self.workers.submit(task)
                self.under_way += 1

    def next_task(self) -> Task | None:
        """The task of the next job; None: there is none, or as of `begin`."""
        most = self.settings.stop_after_failures or math.inf
        job = next(self.jobs, None) if self.failures < most else None
        self.more = job is not None
        return self.begin(job) if job else None

    def begin(self, job: Job) -> Task | None:
        """The task of a job; None: it was done by an earlier run, or cannot be run."""
        number, self.begun = self.begun, self.begun + 1
        if self.total is None:
            self.manifest.plan(number, job)
        kept = self.manifest.find_done(job) if self.settings.resume and not job.error else None
        if kept is None and not job.error:
            return Task(job, self.settings.output, STAGED if self.settings.pack else "", number=number)
        self.add(number, kept or work(Task(job, self.settings.output)))
        return None

    def end(self, ended: TaskEnd) -> None:
        """A task has ended, or its process has."""
        task: Task = ended.task
        if ended.died is None:
            self.add(task.number, ended.answer)
        elif ended.blameless:
            self.again.append(task)
        elif task.attempt < TRIES:
            self.again.append(replace(task, attempt=task.attempt + 1))
        else:
            self.add(task.number, died_row(task.job, ended.died, task.attempt))

    def add(self, number: int, row: JobResult) -> None:
        """Enter a result; OutputError where nothing can be written any more."""
        if not row.kept:
            before = self.manifest.find(row.id)
            if before is not None:
                staged = before.folder.startswith(STAGED)  # the new result takes its place
                earlier = before.replaces or ("" if staged else before.folder)
                row = replace(row, replaces=earlier if self.settings.pack or is_shard(earlier) else "")
            self.manifest.add(row)
        self.packer.add(row)
        self.failures += row.status == "failed"
        self.unwritten = self.unwritten + 1 if row.error_kind == "OutputError" else 0
        self.ready[number] = row
        if self.unwritten >= UNWRITTEN:
            raise OutputError(
                f"the last {UNWRITTEN} results could not be written ({row.error}); what is done is kept, and the same command "
                "resumes it"
            )

    def ready_results(self) -> Iterator[JobResult]:
        """The results that can be handed out now."""
        while self.ready:
            number = self.handed_out if self.settings.ordered else next(iter(self.ready))
            if number not in self.ready:
                return
            self.handed_out += 1
            row = self.ready.pop(number)
            self.settings.progress(row, self.handed_out, self.total)
            yield row
