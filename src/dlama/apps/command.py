"""A verb in; a command under way, with a bar while it lasts and its result in one line at its end, out."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING

from dlama.apps.loading import loading
from dlama.apps.options import Report
from dlama.apps.terminal.output import report_result, stages_bar

if TYPE_CHECKING:
    from dlama.apps.reading import Command

READING = "dlama.apps.reading"
"""All that reads and computes: --help does without."""
STAGES = 20
"""About as many as a command logs: the length of the bar."""


@contextmanager
def command(verb: str, report: Report) -> Iterator[Command]:
    """A command under way: a bar while it lasts, its Result at the end."""
    with report_result(verb, report) as result, stages_bar(verb, STAGES, report):
        with nullcontext() if READING in sys.modules else loading():
            from dlama.apps.reading import Command

        yield Command(result=result)
