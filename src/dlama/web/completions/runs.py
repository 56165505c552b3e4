"""A completion that was asked for in; its progress, warnings, and in the end its result, out. It can be cancelled at any time.

A run ends as its next stage begins: an exception thrown into a thread from outside could hit a compiler or an
allocation half way, which ends in a crash. Its visitor need not wait for that: a cancelled run counts as ended at once.
"""

from __future__ import annotations

import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any

from dlama.errors import DlamaError
from dlama.progress import show_progress

ONE_AT_A_TIME = threading.Semaphore(1)
"""A completion uses all cores and much memory; the next one waits for its turn."""


_WARNED: ContextVar[list[str] | None] = ContextVar("warned", default=None)
"""What takes the warnings of this thread."""


@contextmanager
def warnings_by_thread() -> Iterator[None]:
    """While this is open `warnings_of_thread` works; warnings of other threads go where they went before."""
    with warnings.catch_warnings():
        before = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *rest: object) -> None:
            lines = _WARNED.get()
            if lines is None:
                before(message, category, filename, lineno, *rest)  # type: ignore[arg-type]
            elif str(message) not in lines:
                lines.append(str(message))

        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show  # type: ignore[assignment]
        yield


@contextmanager
def warnings_of_thread() -> Iterator[list[str]]:
    """The warnings of this thread, as a list that grows."""
    lines: list[str] = []
    before = _WARNED.set(lines)
    try:
        yield lines
    finally:
        _WARNED.reset(before)


class Cancelled(BaseException):
    """Raised inside the work that its visitor cancelled; no handler of errors takes it."""


class Run:
    """One completion under way, in a thread of its own."""

    def __init__(self, work: Callable[[], Any], expected: int, turns: bool = False) -> None:
        self.work = work
        self.turns = turns
        """Whether it fills what is hidden from all sides."""
        self.expected = expected
        """About as many stages as it has."""
        self.state = "waiting"
        """waiting, running, done, failed or cancelled."""
        self.stage = ""
        self.stages = 0
        self.warnings: list[str] = []
        self.error: DlamaError | Exception | None = None
        self.result: Any = None
        self.started = time.monotonic()
        self.seconds = 0.0
        self._cancel = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    @property
    def active(self) -> bool:
        """Whether it waits or runs."""
        return self.state in ("waiting", "running")

    def progress(self) -> dict[str, Any]:
        """For the page: state, stage, share (0..1), seconds."""
        seconds = self.seconds or time.monotonic() - self.started
        share = 1.0 if self.state == "done" else min(0.95, self.stages / (self.expected + 1))
        return {"state": self.state, "stage": self.stage, "share": round(share, 3), "seconds": round(seconds, 1)}

    def cancel(self) -> None:
        """Drop it, now for its visitor, and for the machine at its next stage."""
        self._cancel.set()
        if self.active:
            self.state = "cancelled"

    def join(self) -> None:
        """Wait for its end."""
        self._thread.join()

    def _begin_stage(self, name: str) -> None:
        if self._cancel.is_set():
            raise Cancelled
        self.stages += 1
        self.stage = name

    def _run(self) -> None:
        while not ONE_AT_A_TIME.acquire(timeout=0.05):
            if self._cancel.is_set():
                return
        try:
            if not self._cancel.is_set():
                self.state = "running"
                with suppress(Cancelled), show_progress(self._begin_stage), warnings_of_thread() as self.warnings:
                    self.result = self.work()
        except Exception as error:
            self.error = error
            if not isinstance(error, DlamaError):
                traceback.print_exc()
        finally:
            ONE_AT_A_TIME.release()
            del self.work  # and what it holds
            self.seconds = time.monotonic() - self.started
            self.state = "done" if self.error is None else "failed"
            if self._cancel.is_set():
                self.state, self.result = "cancelled", None
