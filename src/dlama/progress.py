"""A callback in; the name of each stage of the work that runs meanwhile, in this thread, handed to it. What it raises ends it.

`progress=print` of a verb prints the stages. To cancel, raise an exception in the callback: nothing half-written is left.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar, cast

Progress = Callable[[str], object]
"""Called with the name of each stage as it begins."""
F = TypeVar("F", bound=Callable[..., Any])
_CALLBACK: ContextVar[Progress | None] = ContextVar("progress", default=None)


@contextmanager
def show_progress(progress: Progress | None) -> Iterator[None]:
    """While this is open the stages of this thread go to `progress`; None: to whom they went before."""
    before = _CALLBACK.set(progress or _CALLBACK.get())
    try:
        yield
    finally:
        _CALLBACK.reset(before)


def begin_stage(name: str) -> None:
    """A stage of the work begins. What the callback itself has dlama do is reported to nobody: it would call itself."""
    progress = _CALLBACK.get()
    if progress is not None:
        before = _CALLBACK.set(None)
        try:
            progress(name)
        finally:
            _CALLBACK.reset(before)


def take_progress(verb: F) -> F:
    """Decorator of a function with the keyword `progress`, to which its stages go."""

    @functools.wraps(verb)
    def run(*args: Any, **named: Any) -> Any:
        progress = named.get("progress")
        with show_progress(progress if callable(progress) else None):  # what is no function the verb itself refuses
            return verb(*args, **named)

    return cast(F, run)
