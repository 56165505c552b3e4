"""A list of jobs in; every job run, on processes of this computer or of many, and its result, as soon as it is there, out."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dlama.arguments import check, check_arguments, check_count, check_word
from dlama.completion.memory import available_bytes
from dlama.completion.options import raise_all
from dlama.errors import InputError, marked_name, require_extra
from dlama.jobs.job import Job, job_of, resolve_path
from dlama.jobs.lists.tables import rows as rows_of
from dlama.jobs.on_ray import RayWorkers
from dlama.jobs.parameters import FILES, KNOWN, NETWORKS, VERBS
from dlama.jobs.perform import work
from dlama.jobs.results.result import JobResult
from dlama.jobs.run import JobProgress, Settings, Workers, run_jobs
from dlama.jobs.storage import Output, folder_of, is_address, local_path
from dlama.models.network_file import processor_count
from dlama.workers.memory import PROCESS_BYTES, check_processes
from dlama.workers.pool import Pool
from dlama.writing.atomic_write import PathLike, check_folder_name

Source = PathLike | Iterable[Mapping[str, Any]]


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
    pack: int | None = None,
    ray: str | None = None,
    gpus_per_worker: float = 0.0,
    progress: JobProgress | None = None,
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
        pack: results go into tar shards of so many, as webdataset reads them, below OUT/shards.
        ray: run on a Ray cluster: local, auto, or HOST:PORT; all its nodes must see the inputs and `out` under the same names.
        gpus_per_worker: on a cluster, the share of a GPU that each worker is given.
        progress: called as results come with three values: the result (None at the start), how many are done, of how many (None:
            not known).
        defaults: parameters of all jobs whose verb takes them (fov=65, filler="migan").

    Raises:
        InputError: a list that cannot be read, two jobs of the same id, an unknown parameter; before anything is run where the
            list can be read twice.
        OutputError: OUT cannot be written, or another run is writing there.
        MissingExtraError: a cluster, an address or Parquet, and the package for it is not installed.
    """
    check_arguments(batch, locals())
    source = JobList(jobs, verb, check_defaults(verb, defaults))
    counts = {"stop_after_failures": stop_after_failures, "pack": pack, "workers": workers, "threads": threads}
    raise_all(functools.partial(check_count, count, name) for name, count in counts.items())
    check_folder_name(out)
    output = Output(str(out) if is_address(str(out)) else str(Path(local_path(str(out))).absolute()))
    settings = Settings(output, ordered, resume, stop_after_failures, pack, progress or (lambda *_: None))
    return run_jobs(source, source.can_be_read_twice, settings, worker_starter(workers, threads, ray, gpus_per_worker))


@dataclass(frozen=True)
class JobList:
    """A list file, or rows; iterated over, its jobs."""

    jobs: Source
    verb: str | None = None
    defaults: Mapping[str, Any] = field(default_factory=dict)

    @property
    def can_be_read_twice(self) -> bool:
        """Files can, and every iterable that is not its own iterator."""
        return self._file is not None or iter(self.jobs) is not self.jobs  # type: ignore[arg-type]

    @property
    def _file(self) -> str | None:
        return str(self.jobs) if isinstance(self.jobs, str | os.PathLike) else None

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
                check(one, Mapping[str, Any], f"job {number}")
                yield job_of(one, self.defaults, str(Path.cwd()), f"job {number}", self.verb)


def check_defaults(verb: str | None, defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Those that are given (not None), files as whole paths. InputError: an unknown verb, or a parameter that no verb has."""
    if verb is not None:
        check_word(verb, "verb", VERBS)
    for name in defaults:
        if name not in KNOWN:
            raise InputError(f"{marked_name(name)} is no parameter of a verb; known are {', '.join(KNOWN)}")
    here = str(Path.cwd())  # of which workers on other computers know nothing
    return {
        name: resolve_path(os.fspath(value), here, name in FILES) if name in (*FILES, *NETWORKS) else value
        for name, value in defaults.items()
        if value is not None
    }


def worker_starter(
    workers: int | None, threads: int | None, ray: str | None, gpus_per_worker: float
) -> Callable[[], Workers]:
    """What starts the workers. InputError: numbers that cannot be. MissingExtraError: Ray is not installed."""
    if ray is None:
        if gpus_per_worker:
            raise InputError(f"`gpus_per_worker` is {gpus_per_worker} without `ray`; it is for clusters")
        chosen = count_workers(workers, threads)
        return lambda: Pool(work, *chosen)
    if gpus_per_worker < 0:
        raise InputError(f"`gpus_per_worker` is {gpus_per_worker}; 0 or more is expected")
    require_extra(f"ray={ray}", "batch", {"ray": "ray"})
    return lambda: RayWorkers(work, ray, workers, threads, gpus_per_worker)


def count_workers(workers: int | None, threads: int | None) -> tuple[int, int]:
    """Processes and threads of each. InputError: below 1, or more than this computer holds."""
    cores, free = processor_count(), available_bytes()
    if workers is not None:
        check_processes(workers, "workers")
    if threads is not None and threads > max(cores, 2):
        raise InputError(f"`threads` is {threads!r}; 1 to {cores}, as many as this computer has cores, is expected")
    fitting = cores if free is None else max(1, min(cores, int(free / PROCESS_BYTES)))
    count = workers or max(1, fitting // (threads or 1))
    return count, threads or max(1, cores // count)
