"""A verb in; a command under way, with a bar while it lasts and its result in one line at its end, out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dlama.apps.options import Report
from dlama.apps.terminal.output import report_result, stages_bar

if TYPE_CHECKING:
    from dlama.apps.reading import Command

STAGES = 20
"""About as many as a command logs: the length of the bar."""


@contextmanager
def command(verb: str, report: Report) -> Iterator[Command]:
    """A command under way: a bar while it lasts, its Result at the end."""
    with report_result(verb, report) as result, stages_bar(verb, STAGES, report):
        from dlama.apps.reading import Command  # all that reads and computes: --help does without

        yield Command(result=result)
