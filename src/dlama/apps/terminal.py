"""A job in; its stages, warnings, errors and one summary line out, on the terminal. Colours and bars on a terminal only."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dlama.completion.pipeline import Completion
from dlama.errors import DlamaError

LOG = logging.getLogger("dlama")

BAD_INPUT = 2
"""Exit code for anything the user can put right."""


@contextmanager
def stages(title: str, total: int) -> Iterator[None]:
    """A progress bar on standard error, on a terminal: every line that dlama logs is one of about `total` stages."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(24), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=total)

        class Stages(logging.Handler):
            def emit(self, record: logging.LogRecord) -> None:
                bar.update(task, advance=1, description=f"{title}: {record.getMessage()}")

        handler, level = Stages(), LOG.level
        LOG.addHandler(handler)
        LOG.setLevel(logging.INFO)
        try:
            yield
        finally:
            LOG.removeHandler(handler)
            LOG.setLevel(level)


@contextmanager
def plain_words() -> Iterator[None]:
    """Errors that the user can put right, and warnings, as one line each on standard error; the former exit with 2."""
    with warnings.catch_warnings():
        warnings.simplefilter("default", UserWarning)
        warnings.showwarning = lambda message, *_, **__: say("warning", str(message))
        try:
            yield
        except DlamaError as error:
            say("error", str(error))
            raise SystemExit(BAD_INPUT) from None
        except BrokenPipeError:  # `dlama --help | head`
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        except KeyboardInterrupt:
            say("error", "interrupted; nothing was written")
            raise SystemExit(130) from None


def say(kind: str, message: str) -> None:
    """One line on standard error; never wrapped, and coloured on a terminal."""
    line = " ".join(message.split())
    if not sys.stderr.isatty():
        print(f"{kind}: {line}", file=sys.stderr)
        return
    from rich.console import Console
    from rich.text import Text

    style = {"error": "bold red", "warning": "bold yellow"}[kind]
    Console(stderr=True, soft_wrap=True).print(Text.assemble((f"{kind}: ", style), line))


def summary(completion: Completion, place: object, seconds: float) -> str:
    """One line: where it lies, what share was unknown and why, who filled it, how long it took."""
    meta = completion.meta
    views = meta["hole_share_by_type"]
    kinds = {name: sum(view[name] for view in views) / len(views) for name in views[0]}
    shares = [f"{name.replace('_', ' ')} {share:.1%}" for name, share in kinds.items() if share >= 5e-4]
    why = f" ({', '.join(shares)})" if shares else ""
    if meta["nothing_visible"]:
        why = "; nothing of the scene is visible from there, so nothing could be filled"
    return f"{place}: {sum(kinds.values()):.1%} was unknown{why}, filler {meta['filler']}, {seconds:.1f} s"


@contextmanager
def shown_count(title: str) -> Iterator[Any]:
    """A bar on a terminal that is told (done, total); None elsewhere."""
    with shown_bar(title) as bar:
        yield None if bar is None else lambda done, total: bar.update(bar.task_ids[0], completed=done, total=total)


@contextmanager
def shown_bar(title: str) -> Iterator[Any]:
    """A bar on a terminal, removed when it is done; None elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

    columns = ("{task.description}", BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        bar.add_task(title, total=None)
        yield bar
