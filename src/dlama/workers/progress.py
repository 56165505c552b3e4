"""How much of a run is done, and what it logs, in; a line about it, one a minute where no bar can be drawn, and messages out."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

LOG = logging.getLogger("dlama")


@contextmanager
def write_line_every(
    line: Callable[[float], str], write: Callable[[str], object], *, every: float = 60.0
) -> Iterator[None]:
    """While this is open, a thread of its own writes a line every so many seconds, however long a single task takes.

    Args:
        line: makes it of the seconds since the start.
        write: takes it.
    """
    started, ended = time.monotonic(), threading.Event()

    def work() -> None:
        while not ended.wait(every):
            write(line(time.monotonic() - started))

    thread = threading.Thread(target=work, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def log_messages(
    show: Callable[[str], object], log: logging.Logger = LOG, without: logging.Logger | None = None
) -> Iterator[None]:
    """What dlama, or one part of it (`without` a part of that), logs meanwhile (level INFO), message by message, in the thread
    that logs it."""

    class Messages(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if without is None or record.name != without.name:
                show(record.getMessage())

    handler, level = Messages(), log.level
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)


def progress_line(title: str, *, kept: int, done: int, total: int | None, failed: int | str, seconds: float) -> str:
    """`street: 12 of 240 done (5 %), 3.0 a minute, 1 h 16 min left`.

    Args:
        kept: how many of `done` an earlier run had left; they do not count for the rate.
        total: None: not known.
        failed: how many, or that in words.
        seconds: since the start.
    """
    counted = f"{done}" if total is None else f"{done} of {total}"
    share = "" if total is None else f" ({done / max(total, 1):.0%})".replace("%", " %")
    parts = [f"{title}: {counted} done{share}"]
    fresh = done - kept
    if fresh > 0 and seconds > 0:
        rate = fresh / seconds
        parts.append(f"{60 * rate:.1f} a minute")
        parts += [] if total is None else [f"{duration((total - done) / rate)} left"]
    else:
        parts.append(f"running for {duration(seconds)}")
    return ", ".join([*parts, *([f"{failed} failed"] if failed else [])])


def duration(seconds: float) -> str:
    """`45 s`, `12 min`, `3 h 05 min`."""
    if seconds < 59.5:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"
