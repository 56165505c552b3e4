"""`dlama batch`: a list of jobs in; every job's results, a manifest and a summary out. `dlama batch report OUT` shows them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional

import dlama
from dlama.apps.options import (
    CompletingOptions,
    Move,
    ObjectOptions,
    Pair,
    PictureOptions,
    Report,
    Together,
    given_options,
    option,
    typed_words,
)
from dlama.apps.places import check_folder_apart
from dlama.apps.terminal.output import FAILED, follow_run, report_result
from dlama.apps.terminal.streams import print_line
from dlama.errors import InputError, format_count
from dlama.jobs.lists.folders import Pictures
from dlama.jobs.results.result import Totals
from dlama.jobs.storage import is_address, local_path

if TYPE_CHECKING:
    from dlama.jobs.batch import JobProgress
    from dlama.jobs.job import Job
    from dlama.jobs.results.result import JobResult

SHOWN_FAILURES = 20
"""Failures that are printed as they happen; the manifest has all."""
SHOWN_JOBS = 10
"""Jobs that --dry-run shows."""


@dataclass(frozen=True)
class Which:
    """What is run, without a list."""

    images: Annotated[str | None, option("PATTERN")] = None
    """Pictures, such as 'rgb/*.png'; ** goes through folders. A job's id is its picture's path from there, without suffix."""
    depths: Annotated[str | None, option("PATTERN", "estimated from the picture")] = None
    """Where a picture's depth lies: 'depth/{stem}.png'; {stem} is its name, {name} that with suffix, {folder} its folder."""
    masks: Annotated[str | None, option("PATTERN")] = None
    """The same of its mask."""
    data: Annotated[Path | None, option("DATASET")] = None
    """A data set, as `dlama evaluate` reads them: view and depth take its frames, remove its removals, stereo its pairs."""
    layout: Annotated[str | None, option("NAME", "recognised")] = None
    """How the data set lies on disk."""
    verb: Annotated[Literal["view", "remove", "stereo", "depth"] | None, option("VERB", "as the list says")] = None
    """view, remove, stereo or depth, of jobs that name none."""


@dataclass(frozen=True)
class Running:
    """How it is run."""

    workers: Annotated[int | None, option("N", "the cores, as far as memory allows")] = None
    """Processes that work side by side; each stays open and keeps its networks and kernels."""
    threads: Annotated[int | None, option("N", "the cores shared between the workers")] = None
    """Threads of each worker."""
    resume: Annotated[bool, option("", "they are kept")] = True
    """Run jobs again that are done with the same inputs and options."""
    stop_after_failures: Annotated[int | None, option("N", "never")] = None
    """Begin no new job after so many failures."""
    pack: Annotated[int | None, option("N", "a folder each")] = None
    """Put results into tar shards of N, as the webdataset package reads them: DIR/shards/000000.tar, ..."""
    ray: Annotated[str | None, option("local|auto|HOST:PORT", "processes of this computer")] = None
    """Run on a Ray cluster; all its nodes must see inputs and results under the same names."""
    gpus_per_worker: Annotated[float, option("SHARE", "0")] = 0.0
    """On a cluster: the share of a GPU that each worker is given."""
    dry_run: Annotated[bool, option("", "off")] = False
    """Run nothing; print how many jobs there are and show the first ten as they would run."""


@dataclass(frozen=True)
class Defaults:
    """What holds for every job whose verb has it."""

    move: Move
    picture: PictureOptions
    chosen: ObjectOptions
    pair: Pair
    completing: CompletingOptions


def batch(
    words: Positional[Annotated[tuple[str, ...], option("[JOBS | report OUT]")]] = (),
    /,
    *,
    output: Annotated[str | None, option("DIR", "needed to run", aliases=["-o"])] = None,
    which: Which,
    running: Running,
    defaults: Annotated[Defaults, Together],
    report: Report,
) -> None:
    """Many jobs at once: a list of them, or a folder of pictures; what is done is kept, what fails is one row.

    Args:
        words: The list: CSV, JSONL or Parquet with id, verb and the verb's options by their names (image, depth, yaw, ...), paths
            from its folder. All other options here hold for every job whose verb has them. `report OUT` makes OUT/report.html.
        output: Results go to DIR/ID/, and DIR/manifest.csv has a row for each job. An address (s3://bucket/out) is taken, too.
    """
    if words[:1] == ("report",):
        write_page(words[1:], report)
        return
    given = given_options(defaults)
    with report_result("batch", report) as result:
        jobs = source(words, which, given, output)
        if running.dry_run:
            for line in plan_lines(jobs, which.verb, given):
                result.add(line)
            return
        place = place_of(output, which.data, words)
        options = {name: value for name, value in vars(running).items() if name != "dry_run"}
        options |= {} if which.data else given  # a data set's jobs have theirs
        totals = Totals()
        with show_progress(report, totals) as progress:
            for row in dlama.batch(jobs, place, verb=which.verb, progress=progress, **options):
                totals.add(row)
        result.add("\n".join(totals.lines(str(place))), **totals.values(str(place)))
    if totals.failed:
        raise SystemExit(FAILED)


def place_of(output: str | None, data: Path | None, words: Sequence[str]) -> Path | str:
    """Where results go: a directory, or an address. InputError: none; OutputError: a directory that is read from."""
    if output is None:
        raise InputError("`output` is missing; a directory for the results is expected: -o DIR")
    if is_address(output):
        return output  # Path makes s3:/ of s3://
    listed = Path(local_path(words[0])) if words and not is_address(words[0]) else None
    check_folder_apart(Path(local_path(output)), {"folder of frames": data, "list of jobs": listed})
    return Path(local_path(output))


def write_page(words: Sequence[str], report: Report) -> None:
    """`dlama batch report OUT`."""
    from dlama.jobs.report import write_report

    if len(words) != 1:
        raise InputError(f"batch report is given {len(words)} folders; one is expected: dlama batch report OUT")
    with report_result("batch report", report) as result:
        page = write_report(words[0])
        result.add(page, report=page)


def source(words: Sequence[str], which: Which, defaults: dict[str, Any], output: str | None = None) -> Any:
    """The list, the pictures of a pattern, or the frames of a data set. InputError: none of them, or two."""
    if len(words) + (which.images is not None) + (which.data is not None) != 1:
        raise InputError(
            f"{len(words)} lists, `images={which.images}` and `data={which.data}`; one list of jobs, "
            "`images=PATTERN` or `data=DATASET` is expected"
        )
    if which.images is None and (which.depths or which.masks):
        raise InputError("`depths` and `masks` go with `images=PATTERN`")
    if which.data is not None:
        from dlama.jobs.lists.data_sets import DatasetJobs

        return DatasetJobs(which.data, which.verb, which.layout, defaults)
    if which.layout is not None:
        raise InputError("`layout` goes with `data=DATASET`")
    if which.images is not None and which.verb is None:
        raise InputError("no verb for the pictures is given: give `verb=VERB`, one of view, remove, depth")
    return words[0] if words else Pictures(str(which.images), which.depths, which.masks, output)


def plan_lines(jobs: Any, verb: str | None, defaults: dict[str, Any]) -> Iterator[str]:
    """What --dry-run prints: how many jobs of each verb, how many cannot run, the first ones, and what is wrong with others."""
    from dlama.jobs.batch import JobList, check_defaults

    counts: dict[str, int] = {}
    wrong, shown, later = 0, list[str](), list[str]()
    for number, job in enumerate(JobList(jobs, verb, check_defaults(verb, defaults))):
        counts[job.verb] = counts.get(job.verb, 0) + 1
        error = job.error or missing_file(job)
        wrong += error is not None
        if number < SHOWN_JOBS:
            shown.append(job_line(job, error))
        elif error is not None and len(later) < SHOWN_JOBS:
            later.append(job_line(job, error))
    kinds = ", ".join(f"{count} {name or 'without a verb'}" for name, count in counts.items())
    yield f"{format_count(sum(counts.values()), 'job')} ({kinds}), {wrong} of them cannot be run; the first ones:"
    yield from shown
    if later:
        yield "the first of the others that cannot be run:"
        yield from later


def job_line(job: Job, error: str | None) -> str:
    """What a job would do, or what is wrong with it."""
    options = " ".join(f"{name}={','.join(typed_words(value))}" for name, value in job.parameters.items())
    return f"  {job.id}: {job.verb or '?'} {error or options}"


def missing_file(job: Job) -> str | None:
    """Which input of a job, of those on this disk, is not there; None: none."""
    files = (path for path in job.files.values() if not is_address(path))
    return next((f"{path}: no such file" for path in files if not Path(path).exists()), None)


@contextmanager
def show_progress(report: Report, totals: Any) -> Iterator[JobProgress]:
    """A bar on a terminal, a line a minute elsewhere; the first failures as a line each. Ctrl-C prints that nothing is lost."""
    started = time.monotonic()
    with follow_run("batch", report, totals.kinds_line) as update:

        def progress(row: JobResult | None, done: int, total: int | None) -> None:
            if row is not None and row.status == "failed":
                if totals.failed < SHOWN_FAILURES:
                    print_line("error", f"{row.id}: {row.error}")
                elif totals.failed == SHOWN_FAILURES:
                    print_line("error", "more jobs failed; the manifest has them all")
            rate = 60 * max(0, done - totals.kept) / max(1e-3, time.monotonic() - started)
            failed = totals.kinds_line()
            note = f"{rate:.1f} a minute{f', {failed} failed' if failed else ''}"
            update(done, total, note, row is not None and row.kept)

        yield progress
