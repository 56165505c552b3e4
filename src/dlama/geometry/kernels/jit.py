"""A loop written in Python in; the same loop as machine code, kept on disk and run on all cores, out.

What keeps the first run of all short, when every kernel has yet to be compiled: kernels are plain scalar loops that write into
arrays they are handed, allocate nothing, and run over rows [first, last), so that `in_bands` can spread them over threads.
(numba's own parallel loops take twice as long to compile, an allocation costs as much as thirty lines.)
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from numba import config, njit

kernel = njit(cache=True, nogil=True, error_model="numpy")
"""Decorator of what is called from Python: compiled at its first call, then kept on disk."""
piece = njit(error_model="numpy")
"""Decorator of what kernels are made of: stored as a part of them, not by itself."""
inlined = njit(error_model="numpy", forceinline=True)
"""As `piece`, for what is handed several arrays for every pixel: the call would cost more than the work."""

BAND = 32
"""Rows per task: enough of them that threads finish together, not so many that handing them out costs."""


def threads() -> int:
    """How many threads kernels may use (numba's own setting, NUMBA_NUM_THREADS; the cores of this process by default)."""
    return int(vars(config)["NUMBA_NUM_THREADS"])


def in_bands(job: Callable[..., None], rows: int, *arguments: Any, band: int = BAND) -> None:
    """job(first, last, *arguments) for bands of rows that together are range(rows), in any order, on all cores.

    Bands must not depend on each other, so that the result does not depend on the number of threads; an empty one, which comes
    first, must do nothing.
    """
    count = min(threads(), -(-rows // band))
    if count < 2:
        job(0, rows, *arguments)
        return
    job(0, 0, *arguments)  # compiled, or loaded, before threads call it: numba's dispatcher does not stand two at once
    starts = iter(range(0, rows, band))  # shared: each thread takes the next one

    def work() -> None:
        for first in starts:
            job(first, min(rows, first + band), *arguments)

    others = [_pool().submit(work) for _ in range(count - 1)]
    try:
        work()
    finally:
        for other in others:
            other.result()


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, threads() - 1), "dlama")


if hasattr(os, "register_at_fork"):  # threads do not survive a fork: the child makes its own
    os.register_at_fork(after_in_child=_pool.cache_clear)
