"""A long run that can be taken up again in; a bar on a terminal, a line a minute elsewhere, and what Ctrl-C means for it, out."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from dlama.apps.options import Report
from dlama.apps.terminal.output import counting_bar, print_line
from dlama.apps.terminal.streams import describe_ending, exit_code

MINUTE = 60.0
"""Seconds between two lines about progress where there is no terminal."""


@contextmanager
def bar_or_lines(
    title: str, report: Report, lines: Callable[..., AbstractContextManager[Any]]
) -> Iterator[tuple[Any, Any]]:
    """During a run: the bar (`counting_bar`; None without a terminal), and what `lines` gives (None on a terminal).

    Ctrl-C ends with a line that says that nothing is lost.

    Args:
        lines: (write, every=seconds) -> while it is open, lines about progress are handed to `write`.
    """

    def write(line: str) -> None:
        print_line("progress", line)

    try:
        without_lines = report.quiet or sys.stderr.isatty()
        minutes = nullcontext() if without_lines else lines(write, every=MINUTE)
        with counting_bar(title, report) as bar, minutes as lines_or_none:
            yield bar, lines_or_none
    except KeyboardInterrupt as error:
        print_line("error", f"{describe_ending(error)}; what is done is kept, and the same command resumes it")
        raise SystemExit(exit_code(error)) from None
