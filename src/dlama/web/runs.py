"""A completion that was asked for in; its progress, and in the end its result, out. It can be cancelled at any time."""

from __future__ import annotations

import ctypes
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any

from dlama.errors import DlamaError
from dlama.web.listening import listening

ONE_AT_A_TIME = threading.Semaphore(1)
"""A completion uses all cores and much memory; the next visitor's waits."""
CANCEL_SECONDS = 0.05


class Cancelled(BaseException):
    """Raised inside a run that its visitor cancelled; no handler of the library's takes it for an error."""


class Run:
    """One completion under way, in a thread of its own."""

    def __init__(self, work: Callable[[], Any], expected: int) -> None:
        self.work = work
        self.finish: Callable[[Any], Any] = _same
        """What becomes of what `work` gives."""
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

    def cancel(self, wait: float = 0.0) -> None:
        """Stop it between two steps of its Python code; its result is dropped. Waits up to so many seconds for its end."""
        self._cancel.set()
        if self.active:
            self.state = "cancelled"
        deadline = time.monotonic() + wait
        while self._thread.is_alive():
            self._raise_inside()
            if time.monotonic() >= deadline:
                return
            self._thread.join(CANCEL_SECONDS)

    def join(self) -> None:
        """Wait for its end."""
        self._thread.join()

    def _raise_inside(self) -> None:
        number = self._thread.ident
        if number is not None:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(number), ctypes.py_object(Cancelled))

    def _heard(self, message: str) -> None:
        if self._cancel.is_set():
            raise Cancelled
        self.stages += 1
        self.stage = message

    def _run(self) -> None:
        try:
            while not ONE_AT_A_TIME.acquire(timeout=0.1):
                if self._cancel.is_set():
                    return
            try:
                if not self._cancel.is_set():
                    self._work()
            finally:
                ONE_AT_A_TIME.release()
        except Cancelled:
            self.state = "cancelled"
        finally:
            self.work, self.finish = _nothing, _same
            self.seconds = time.monotonic() - self.started

    def _work(self) -> None:
        self.state = "running"
        with listening(self._heard) as warned:
            self.warnings = warned
            try:
                result = self.finish(self.work())
            except Exception as error:
                self.error = error
                if not isinstance(error, DlamaError):
                    traceback.print_exc()
        if self._cancel.is_set():
            self.state = "cancelled"
        elif self.error is not None:
            self.state = "failed"
        else:
            self.result, self.state = result, "done"


def _nothing() -> None:
    return None


def _same(value: Any) -> Any:
    return value
