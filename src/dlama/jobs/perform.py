"""One job in; its results in a folder, and a row that says what came of it, out. Runs in any process.

What computes is imported where a job is run: the process that hands out jobs computes nothing, and stays small.
"""

from __future__ import annotations

import json
import re
import socket
import statistics
import time
import traceback
import warnings
from dataclasses import dataclass, replace
from typing import Any

from dlama.errors import DlamaError, InputError
from dlama.jobs.job import Job
from dlama.jobs.results.result import JobResult
from dlama.jobs.storage import MARKER, Output, fetch, file_stamp
from dlama.models.verify import sha256_of
from dlama.workers.memory import peak_mib, reset_peak
from dlama.writing.drafts import DRAFT

RESULT = "result"
"""The folder of a result while it is made."""
HALF_MADE = re.compile(rf"\S*?{re.escape(DRAFT)}[^/]*/(?:{re.escape(DRAFT)}[^/]*|{RESULT}\b)")
"""The path of a result while it is made; a message names the one that it was to have."""


@dataclass(frozen=True)
class Task:
    """A job, and where its results go."""

    job: Job
    output: Output
    prefix: str = ""
    """Before the id, below OUT: `staged/` where results are packed."""
    attempt: int = 1
    number: int = 0
    """Its place in the list."""


def work(task: Task) -> JobResult:
    """Run a job. Any error of a bad input becomes a failed row; MemoryError is raised, so that the process is replaced."""
    since_reset, started = reset_peak(), time.perf_counter()
    job = task.job
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        try:
            row = _perform(task)
        except MemoryError:
            raise
        except Exception as error:
            row = failed_row(job, error)
            row = replace(row, error=HALF_MADE.sub(lambda _: task.output.of(job.id), row.error))
    peak = peak_mib(since_reset)
    return replace(
        row,
        seconds=round(time.perf_counter() - started, 4),
        peak_mib=peak and round(peak, 1),
        host=socket.gethostname(),
        attempts=task.attempt,
        finished=round(time.time(), 3),
        options_hash=job.options_hash if row.status == "done" else "",
        warnings=tuple(dict.fromkeys(" ".join(str(one.message).split()) for one in caught)),
    )


def failed_row(job: Job, error: Exception) -> JobResult:
    """The row of a job that could not be run."""
    trace = "" if isinstance(error, DlamaError) else "".join(traceback.format_exception(error))
    kind = type(error).__name__
    return JobResult(job.id, "failed", job.verb, kind, " ".join(str(error).split()) or kind, trace=trace)


def died_row(job: Job, how: str, attempts: int) -> JobResult:
    """The row of a job whose process died, `how` in words, as often as it may."""
    line = f"its process ended {attempts} times while it ran ({how})"
    about = {"attempts": attempts, "finished": round(time.time(), 3), "host": socket.gethostname()}
    return JobResult(job.id, "failed", job.verb, "WorkerDied", line, **about)  # type: ignore[arg-type]


def _perform(task: Task) -> JobResult:
    job = task.job
    if job.error:
        raise InputError(job.error)
    from dlama.jobs.verbs import run_verb

    stamps = {
        role: file_stamp(path) for role, path in job.files.items()
    }  # before they are read: a change meanwhile is seen
    with task.output.staging() as folder, fetch(job.files) as files:
        run_verb(job, files, folder / RESULT)
        meta = json.loads((folder / RESULT / MARKER).read_text("utf-8"))
        hashes = {role: one["sha256"] for role, one in meta.get("inputs", {}).items()}
        inputs = {
            role: {"path": job.files[role], "sha256": hashes.get(role) or sha256_of(path), "stamp": stamps[role]}
            for role, path in files.items()
        }
        place = f"{task.prefix}{job.id}"
        task.output.put(folder / RESULT, place)
    figures: dict[str, Any] = {name: _mean(meta.get(name)) for name in ("hole_share", "depth_only_share")}
    figures |= {name: meta.get(name) for name in ("law_moves", "law_violations")}
    return JobResult(job.id, "done", job.verb, folder=place, seconds_by_stage=meta["seconds"], inputs=inputs, **figures)


def _mean(values: list[float] | None) -> float | None:
    return round(statistics.fmean(values), 6) if values else None
