"""A thread's work in; what the library logs and warns of meanwhile, in that thread alone, out."""

from __future__ import annotations

import logging
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

LOG = logging.getLogger("dlama")


class Heard(threading.local):
    """Who listens in this thread."""

    stage: Callable[[str], None] | None = None
    warned: list[str] | None = None


_heard = Heard()


class _Stages(logging.Handler):
    """Hands what is logged to whoever listens in the thread that logs it."""

    def emit(self, record: logging.LogRecord) -> None:
        if _heard.stage is not None:
            _heard.stage(record.getMessage())


@contextmanager
def ears() -> Iterator[None]:
    """While this is open `listening` hears; of other threads warnings go where they went before."""
    handler, level = _Stages(), LOG.level
    with warnings.catch_warnings():
        before = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *rest: object) -> None:
            if _heard.warned is None:
                before(message, category, filename, lineno, *rest)  # type: ignore[arg-type]
            elif str(message) not in _heard.warned:
                _heard.warned.append(str(message))

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
def listening(stage: Callable[[str], None] | None = None) -> Iterator[list[str]]:
    """The warnings of this thread, as a list that grows; `stage` is called with each message that is logged."""
    before = _heard.stage, _heard.warned
    _heard.stage, _heard.warned = stage, []
    try:
        yield _heard.warned
    finally:
        _heard.stage, _heard.warned = before
