"""A verb under way in; its stages, warnings, errors and result out, on the terminal. Colours and bars on a terminal only."""

from __future__ import annotations

import json
import logging
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from dlama.apps.options import Report
from dlama.errors import DlamaError

LOG = logging.getLogger("dlama")
KERNELS = logging.getLogger("dlama.kernels")
"""Says that kernels are being compiled (`geometry.kernels.jit`, which is too heavy to be imported here)."""

BAD_INPUT = 2
"""Exit code for anything the user can put right."""
INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""


@dataclass
class Result:
    """What a verb did: lines to read, and the same as JSON-ready values."""

    lines: list[str] = field(default_factory=list)
    values: dict[str, Any] = field(default_factory=dict)

    def add(self, line: str, **values: Any) -> None:
        """One more line, and what it says."""
        self.lines.append(line)
        self.values |= values


@contextmanager
def reported(verb: str, report: Report) -> Iterator[Result]:
    """Warnings and notes of what runs inside, a line each; at its end its Result, if it has one, as lines or one JSON object."""
    result, warned, started = Result(), [], time.perf_counter()

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        warned.append(" ".join(str(message).split()))
        if not report.quiet:
            print_line("warning", str(message))

    with warnings.catch_warnings():
        warnings.simplefilter("default", UserWarning)
        warnings.showwarning = show
        with log_messages(lambda note: None if report.quiet else print_line("note", note), KERNELS):
            yield result
    if not result.lines:
        return
    if report.json:
        seconds = round(time.perf_counter() - started, 3)
        print(json.dumps({"verb": verb, **result.values, "seconds": seconds, "warnings": warned}))
    elif not report.quiet:
        print("\n".join(result.lines))


@contextmanager
def errors_as_lines(with_flags: Callable[[str], str] = str) -> Iterator[None]:
    """Errors that the user can put right as one line on standard error, `with_flags` for parameters; exit code 2."""
    try:
        yield
    except DlamaError as error:
        print_line("error", with_flags(str(error)))
        raise SystemExit(BAD_INPUT) from None
    except BrokenPipeError:  # `dlama --help | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        print_line("error", "interrupted; nothing was written")
        raise SystemExit(INTERRUPTED) from None


def print_line(kind: str, message: str) -> None:
    """One line on standard error that begins with its kind (error, warning, note); never wrapped, and coloured on a terminal."""
    line = " ".join(message.split())
    if not sys.stderr.isatty():
        print(f"{kind}: {line}", file=sys.stderr)
        return
    from rich.console import Console
    from rich.text import Text

    style = {"error": "bold red", "warning": "bold yellow"}.get(kind, "bold")
    Console(stderr=True, soft_wrap=True).print(Text.assemble((f"{kind}: ", style), line))


@contextmanager
def log_messages(show: Callable[[str], None], log: logging.Logger = LOG) -> Iterator[None]:
    """What dlama, or one part of it, logs meanwhile, message by message."""

    class Messages(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            show(record.getMessage())

    handler, level = Messages(), log.level
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)


@contextmanager
def stages_bar(title: str, total: int, report: Report) -> Iterator[None]:
    """A progress bar on standard error, on a terminal: each message that dlama logs is one of about `total` stages."""
    if report.quiet or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(24), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=total)
        with log_messages(lambda message: bar.update(task, advance=1, description=f"{title}: {message}")):
            yield


@contextmanager
def counting_bar(title: str, report: Report) -> Iterator[Any]:
    """A bar on a terminal, removed when it is done, as a function of (done, total, title); None elsewhere."""
    if report.quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

    columns = ("{task.description}", BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=None)
        yield lambda done, total, title=title: bar.update(task, completed=done, total=total, description=title)
