"""How much of a run is done in; a line a minute out: for logs and pipes, where no bar can be drawn."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from dlama.evaluation.runner.run import Progress
from dlama.evaluation.runner.worker import Outcome


@contextmanager
def progress_lines(title: str, write: Callable[[str], object], *, every: float = 60.0) -> Iterator[Progress]:
    """Hand `run` what this yields; while it works, a line is written every so many seconds.

    A thread of its own writes them, so they come on time however long a single case takes.

    Args:
        title: begins each line.
        write: takes a line.
        every: seconds between two lines.
    """
    started, ended = time.monotonic(), threading.Event()
    counts = {"kept": 0, "done": 0, "total": 0, "failed": 0}

    def progress(outcome: Outcome | None, done: int, total: int) -> None:
        counts.update(done=done, total=total)
        if outcome is None:
            counts["kept"] = done
        elif outcome.error:
            counts["failed"] += 1

    def work() -> None:
        while not ended.wait(every):
            write(progress_line(title, **counts, seconds=time.monotonic() - started))

    thread = threading.Thread(target=work, name="progress", daemon=True)
    thread.start()
    try:
        yield progress
    finally:
        ended.set()
        thread.join()


def progress_line(title: str, *, kept: int, done: int, total: int, failed: int, seconds: float) -> str:
    """`street: 12 of 240 done (5 %), 3.0 a minute, 1 h 16 min left`.

    Args:
        kept: how many of `done` an earlier run had left; they say nothing about the rate.
        seconds: since the start.
    """
    parts = [f"{title}: {done} of {total} done ({done / max(total, 1):.0%})".replace("%", " %")]
    fresh = done - kept
    if fresh > 0 and seconds > 0:
        rate = fresh / seconds
        parts += [f"{60 * rate:.1f} a minute", f"{duration((total - done) / rate)} left"]
    else:
        parts.append(f"running for {duration(seconds)}")
    return ", ".join([*parts, *([f"{failed} failed"] if failed else [])])


def duration(seconds: float) -> str:
    """`45 s`, `12 min`, `3 h 05 min`."""
    if seconds < 59.5:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"
