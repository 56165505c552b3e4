"""A thread's work in; what the library logs and warns of meanwhile, in that thread alone, out."""

from __future__ import annotations

import logging
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

LOG = logging.getLogger("dlama")


class _Receivers(threading.local):
    """What takes the messages of this thread."""

    stage: Callable[[str], None] | None = None
    warned: list[str] | None = None


_receivers = _Receivers()


class _Stages(logging.Handler):
    """Hands what is logged to the receiver of the thread that logs it."""

    def emit(self, record: logging.LogRecord) -> None:
        if _receivers.stage is not None:
            _receivers.stage(record.getMessage())


@contextmanager
def messages_by_thread() -> Iterator[None]:
    """While this is open `messages_of_thread` works; warnings of other threads go where they went before."""
    handler, level = _Stages(), LOG.level
    with warnings.catch_warnings():
        before = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *rest: object) -> None:
            if _receivers.warned is None:
                before(message, category, filename, lineno, *rest)  # type: ignore[arg-type]
            elif str(message) not in _receivers.warned:
                _receivers.warned.append(str(message))

        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show  # type: ignore[assignment]
        LOG.addHandler(handler)
        LOG.setLevel(logging.INFO)
        try:
            yield
        finally:
            LOG.removeHandler(handler)
            LOG.setLevel(level)


@contextmanager
def messages_of_thread(stage: Callable[[str], None] | None = None) -> Iterator[list[str]]:
    """The warnings of this thread, as a list that grows; `stage` is called with each message that is logged."""
    before = _receivers.stage, _receivers.warned
    _receivers.stage, _receivers.warned = stage, []
    try:
        yield _receivers.warned
    finally:
        _receivers.stage, _receivers.warned = before
