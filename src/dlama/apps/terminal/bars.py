"""A title and columns in; a progress bar on a terminal's standard error, and coloured lines, out. Loads rich: import it late."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)
from rich.text import Text

TITLE = TextColumn("{task.description}", markup=False)
STAGES = (SpinnerColumn(), TITLE, BarColumn(24), TimeElapsedColumn())
"""Of work in stages."""
COUNT = (TITLE, BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
"""Of so many of how many."""
BYTES = (TITLE, BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
"""Of a download."""


@contextmanager
def open_bar(
    title: str, columns: tuple[ProgressColumn, ...], total: int | None = None
) -> Iterator[Callable[..., None]]:
    """A bar that is removed when it is done, as a function that changes it: completed, total, advance, description."""
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        yield functools.partial(bar.update, bar.add_task(title, total=total))


def print_colored(kind: str, line: str) -> None:
    """A line on standard error that begins with its kind in colour; never wrapped."""
    style = {"error": "bold red", "warning": "bold yellow"}.get(kind, "bold")
    Console(stderr=True, soft_wrap=True).print(Text.assemble((f"{kind}: ", style), line))
