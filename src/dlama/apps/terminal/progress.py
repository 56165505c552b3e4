"""A long run that can be taken up again in; a bar on a terminal, a line a minute elsewhere, and what Ctrl-C means for it, out."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

from dlama.apps.options import Report
from dlama.apps.terminal.output import counting_bar, print_line
from dlama.apps.terminal.streams import describe_ending, exit_code
from dlama.workers.progress import write_line_every

MINUTE = 60.0
"""Seconds between two lines about progress where there is no terminal."""


@contextmanager
def bar_or_lines(title: str, report: Report, line: Callable[[float], str]) -> Iterator[Any]:
    """During a run: the bar (`counting_bar`) on a terminal, None elsewhere, where `line` of the seconds since the start is
    printed once a minute. Ctrl-C ends with a line that says that nothing is lost."""
    try:
        without_lines = report.quiet or sys.stderr.isatty()
        minutes = nullcontext() if without_lines else write_line_every(line, _print, every=MINUTE)
        with counting_bar(title, report) as bar, minutes:
            yield bar
    except KeyboardInterrupt as error:
        print_line("error", f"{describe_ending(error)}; what is done is kept, and the same command resumes it")
        raise SystemExit(exit_code(error)) from None


def _print(line: str) -> None:
    print_line("progress", line)
