"""Tasks that cost nothing or end their process, importable by name so that they travel to other processes."""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path
from typing import Any


def square(number: int) -> tuple[int, int, str]:
    """The square, the process that made it, and the threads it was given."""
    return number * number, os.getpid(), os.environ["OMP_NUM_THREADS"]


def deadly(task: tuple[str, Any]) -> Any:
    """("square", n); ("kill", a file): killed unless the file is there; ("memory", _); ("exit", code)."""
    what, value = task
    if what == "square":
        return value * value
    if what == "kill":
        if value is None or not Path(value).exists():
            if value is not None:
                Path(value).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return "lived"
    if what == "memory":
        raise MemoryError
    if what == "wait":
        threading.Event().wait()  # until it is killed
    os._exit(value)
