"""A thread's work in; what the library logs and warns of meanwhile, in that thread alone, out."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from dlama.workers.progress import log_messages


class _Receivers(threading.local):
    """What takes the messages of this thread."""

    stage: Callable[[str], None] | None = None
    warned: list[str] | None = None


_receivers = _Receivers()


def _stage(message: str) -> None:
    """Hands what is logged to the receiver of the thread that logs it."""
    if _receivers.stage is not None:
        _receivers.stage(message)


@contextmanager
def messages_by_thread() -> Iterator[None]:
    """While this is open `messages_of_thread` works; warnings of other threads go where they went before."""
    with warnings.catch_warnings(), log_messages(_stage):
        before = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *rest: object) -> None:
            if _receivers.warned is None:
                before(message, category, filename, lineno, *rest)  # type: ignore[arg-type]
            elif str(message) not in _receivers.warned:
                _receivers.warned.append(str(message))

        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show  # type: ignore[assignment]
        yield


@contextmanager
def messages_of_thread(stage: Callable[[str], None] | None = None) -> Iterator[list[str]]:
    """The warnings of this thread, as a list that grows; `stage` is called with each message that is logged."""
    before = _receivers.stage, _receivers.warned
    _receivers.stage, _receivers.warned = stage, []
    try:
        yield _receivers.warned
    finally:
        _receivers.stage, _receivers.warned = before
