"""How much of an evaluation is done in; a line a minute out: for logs and pipes, where no bar can be drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from dlama.evaluation.runner.run import Progress
from dlama.evaluation.runner.worker import Outcome
from dlama.workers.progress import progress_line, write_line_every


@contextmanager
def progress_lines(title: str, write: Callable[[str], object], *, every: float = 60.0) -> Iterator[Progress]:
    """Hand `run` what this yields; while it works, a line is written every so many seconds.

    Args:
        title: begins each line.
        write: takes a line.
        every: seconds between two lines.
    """
    counts = {"kept": 0, "done": 0, "total": 0, "failed": 0}

    def progress(outcome: Outcome | None, done: int, total: int) -> None:
        counts.update(done=done, total=total)
        if outcome is None:
            counts["kept"] = done
        elif outcome.error:
            counts["failed"] += 1

    with write_line_every(lambda seconds: progress_line(title, **counts, seconds=seconds), write, every=every):
        yield progress
