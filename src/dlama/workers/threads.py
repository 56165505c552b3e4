"""A number of threads in; this process, or those started meanwhile, computing on so many, out."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""What libraries read as they are loaded."""


def become_worker(threads: int) -> None:
    """Make this process compute on so many cores, end with the one that started it, and leave Ctrl-C to that."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name="end with parent", daemon=True).start()
    limit_threads(threads)


def limit_threads(threads: int) -> None:
    """Make this process compute on so many cores, also with libraries that are loaded already."""
    import cv2

    from dlama.geometry.kernels.jit import use_threads

    os.environ.update(dict.fromkeys(VARIABLES, str(threads)))
    cv2.setNumThreads(threads)
    use_threads(threads)


@contextmanager
def threads_of_new_processes(threads: int) -> Iterator[None]:
    """Processes started meanwhile begin with so many threads, as libraries read these variables when they are loaded."""
    before = {name: os.environ.get(name) for name in VARIABLES}
    os.environ.update(dict.fromkeys(VARIABLES, str(threads)))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def hold_interrupts() -> Iterator[None]:
    """Ctrl-C waits; processes started meanwhile never get one, which would end them with a traceback while they load."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # where the first process starts it, interrupts get through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent() -> None:
    """No process outlives the one that started it, however that ends."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
