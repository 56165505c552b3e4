"""A verb under way in; its stages, warnings, errors and result out, on the terminal. Colours and bars on a terminal only."""

from __future__ import annotations

import errno
import itertools
import json
import logging
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from dlama.apps.options import Report
from dlama.apps.terminal.streams import (
    CANNOT_WRITE,
    find_write_error,
    open_closed_streams,
    print_line,
    printable,
    show_any_text,
    signals_raise,
)
from dlama.errors import DlamaError, describe_system_error, system_reason
from dlama.progress import show_progress
from dlama.workers.progress import log_messages, progress_line, write_line_every

KERNELS = logging.getLogger("dlama.kernels")
"""Reports that kernels are being compiled (`geometry.kernels.jit`, which is too heavy to be imported here)."""

SHOWN = 5e-4
"""The smallest share of a picture that a line about a result names: 0.1 % when rounded."""
FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130
"""Exit codes: some jobs or cases failed, or inputs are wrong; for anything the user can put right; of a Ctrl-C that did not come
as `Stopped`."""
WITH_FLAGS: ContextVar[Callable[[str], str]] = ContextVar("WITH_FLAGS", default=str)
"""Puts the flags of the verb under way in place of the parameters that a message of the library names."""
MINUTE = 60.0
"""Seconds between two lines about progress where there is no terminal."""
STREAM_ERRORS = (errno.ENOSPC, errno.EPIPE, errno.EIO, errno.EBADF, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))
"""Errors of a full or broken stream."""


@dataclass
class Result:
    """What a verb did: lines to read, and the same as JSON-ready values."""

    lines: list[str] = field(default_factory=list)
    values: dict[str, Any] = field(default_factory=dict)
    started: float = field(default_factory=time.perf_counter)

    @property
    def seconds(self) -> float:
        """Since the verb began."""
        return time.perf_counter() - self.started

    def add(self, line: str, **values: Any) -> None:
        """One more line, and its values."""
        self.lines.append(line)
        self.values |= values


@contextmanager
def report_result(verb: str, report: Report) -> Iterator[Result]:
    """Warnings and notes of what runs inside, a line each; at its end its Result, if it has one, as lines or one JSON object."""
    result, warned = Result(), list[str]()

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        line = " ".join(WITH_FLAGS.get()(str(message)).split())
        if line in warned:  # of each frame of a folder
            return
        warned.append(line)
        if not report.quiet:
            print_line("warning", line)

    def compiling(note: str) -> None:
        from dlama.geometry.kernels.ahead import help_compiling

        if not report.quiet:
            print_line("note", note)
        help_compiling(verb)

    with warnings.catch_warnings():
        warnings.simplefilter("default", UserWarning)
        warnings.showwarning = show
        with log_messages(compiling, KERNELS):
            yield result
    if not result.lines:
        return
    if report.json:
        print(json.dumps({"verb": verb, **result.values, "seconds": round(result.seconds, 3), "warnings": warned}))
    elif not report.quiet:
        print(printable("\n".join(result.lines)))


@contextmanager
def errors_as_lines(with_flags: Callable[[str], str] = str) -> Iterator[None]:
    """Errors that the user can put right as one line on standard error, `with_flags` for parameters; exit code 2.

    A signal ends with a line and its usual exit code (130, 143), a full standard output with a line and CANNOT_WRITE.
    """
    WITH_FLAGS.set(with_flags)
    open_closed_streams()
    show_any_text()
    code: int | str | None = None
    try:
        with signals_raise(), warnings.catch_warnings():
            # those that come before a verb reports: what it imports warns of kernels that cannot be kept
            warnings.showwarning = lambda message, *_, **__: print_line("warning", str(message))
            try:
                yield
            except KeyboardInterrupt as error:
                code = getattr(error, "exit_code", INTERRUPTED)
                print_line("error", f"{getattr(error, 'word', 'interrupted')}; nothing half-written is left")
    except SystemExit as error:  # of --help, and of wrong words
        code = error.code
    except (DlamaError, MemoryError, OSError) as error:
        code = _explain(error)
    full = find_write_error(sys.stdout)
    if full is not None and code in (None, 0):
        code = _explain(full)
    find_write_error(sys.stderr)
    if code is not None:
        raise SystemExit(code)


def _explain(error: DlamaError | MemoryError | OSError) -> int | None:
    """A line about an error that the user can put right; the exit code."""
    if isinstance(error, BrokenPipeError):  # `dlama --help | head`
        return None
    if isinstance(error, DlamaError):
        line = WITH_FLAGS.get()(error.marked) + (f" (see {error.guide})" if error.guide else "")
    elif isinstance(error, MemoryError):
        line = f"out of memory{f': {error}' if str(error) else ''}; smaller pictures or fewer --jobs may help"
    elif error.filename is None and error.errno in STREAM_ERRORS:
        print_line("error", f"output cannot be written: {system_reason(error)}")
        return CANNOT_WRITE
    else:
        line = describe_system_error(error)
    print_line("error", line)
    return BAD_INPUT


@contextmanager
def stages_bar(title: str, total: int, report: Report) -> Iterator[None]:
    """A progress bar on standard error, on a terminal: stages are about `total`."""
    if report.quiet or not sys.stderr.isatty():
        yield
        return
    from dlama.apps.terminal import bars

    begun = itertools.count(1)
    with bars.open_bar(title, bars.STAGES, total) as update:

        def show_stage(stage: str) -> None:  # short of the total, at which the bar's clock would stop
            update(completed=min(next(begun), total - 1), description=printable(f"{title}: {stage}"))

        with show_progress(show_stage):
            yield


@contextmanager
def counting_bar(title: str, report: Report, of_bytes: bool = False) -> Iterator[Any]:
    """A bar on a terminal, removed when it is done, as a function of (done, total, title), which does nothing elsewhere."""
    if report.quiet or not sys.stderr.isatty():
        yield lambda *_: None
        return
    from dlama.apps.terminal.bars import BYTES, COUNT, open_bar

    with open_bar(title, BYTES if of_bytes else COUNT) as update:
        yield lambda done, total, title=title: update(completed=done, total=total, description=printable(title))


@contextmanager
def follow_run(
    title: str, report: Report, failed: Callable[[], int | str] = lambda: 0
) -> Iterator[Callable[[int, int | None, str, bool], None]]:
    """How far a long run is, as a function of (done, total, note, earlier) says: a bar on a terminal, elsewhere a line a minute.

    total: None: not known; note: behind the title; earlier: what is new in `done` was left by an earlier run. failed: how many,
    or that in words. Until something is done the stages of the work are shown. Ctrl-C ends with a line that says that nothing is
    lost.
    """
    state: dict[str, Any] = {"done": 0, "total": None, "kept": 0}
    at_first = title

    def line(seconds: float) -> str:
        return progress_line(title if state["done"] else at_first, failed=failed(), seconds=seconds, **state)

    lines = not (report.quiet or sys.stderr.isatty())
    minutes = write_line_every(line, partial(print_line, "progress"), every=MINUTE) if lines else nullcontext()
    try:
        with counting_bar(title, report) as bar, minutes:

            def update(done: int, total: int | None, note: str, earlier: bool) -> None:
                state["kept"] += earlier * (done - state["done"])
                state.update(done=done, total=total)
                bar(done, total, f"{title}: {note}" if note else title)

            def show_stage(stage: str) -> None:  # of what comes before the first result
                nonlocal at_first
                at_first = f"{title}, {stage}"
                if not state["done"]:
                    bar(0, state["total"], f"{title}: {stage}")

            with show_progress(show_stage):
                yield update
    except KeyboardInterrupt as error:
        word = getattr(error, "word", "interrupted")
        print_line("error", f"{word}; what is done is kept, and the same command resumes it")
        raise SystemExit(getattr(error, "exit_code", INTERRUPTED)) from None
