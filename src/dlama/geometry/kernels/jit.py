"""A loop written in Python in; the same loop as machine code, kept on disk and run on all cores, out. numba is set up here only.

What keeps the first run of all short, when every kernel has yet to be compiled:

- Kernels are plain scalar loops that write into arrays they are handed, allocate nothing, and run over rows [first, last), so
  that `in_bands` can spread them over threads. numba's own parallel loops take twice as long to compile, an allocation as long
  as thirty lines, the assignment of a slice as long as three hundred (its error message is compiled too).
- Arrays that belong together are one NamedTuple, also between a kernel and its pieces: it costs nothing.
- No unused entry points: kernels cannot be called from C, pieces neither from C nor from Python.
- Python's garbage collector waits while numba compiles.
- One signature each: a literal (`count = 0`, a bare `1`) or another width of float compiles a piece a second time.
"""

from __future__ import annotations

import functools
import gc
import logging
import os
import threading
import warnings
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from dlama.errors import InputError

asked = os.environ.get("NUMBA_NUM_THREADS", "1")
if not asked.strip().isdecimal() or int(asked) < 1:  # numba would end in a traceback
    raise InputError(f"the environment variable NUMBA_NUM_THREADS is {asked!r}; a whole number, 1 or more, is expected")

from numba import config, njit  # noqa: E402
from numba.core.event import Event, Listener, register  # noqa: E402

from dlama.geometry.kernels.stored import KernelCache, warn_not_kept  # noqa: E402

if vars(config)["DISABLE_JIT"]:
    # NumPy 2 computes float32 with a Python number in float32; machine code does in float64, as NumPy 1 did
    warnings.warn(
        "NUMBA_DISABLE_JIT is set: kernels run as Python, hundreds of times slower, and depth may differ in its last bit",
        UserWarning,
        stacklevel=1,
    )

LOG = logging.getLogger("dlama.kernels")
"""Says, once a process, that kernels are being compiled (at level INFO; the command line shows it)."""
COMPILING = "compiling kernels that no earlier command needed, which takes about 10 seconds; later runs find them ready"

Whole = int | np.int64
"""A whole number between kernels and their pieces; to numba both are int64."""
Pixel = tuple[Whole, Whole]
"""Row and column."""
Real = Any
"""A number between kernels and their pieces: float64 or float32, as the caller's is. Not checked, for Python's own rules for
mixing the two are not numba's, which alone count here."""
Flag = bool | np.bool_
"""A truth value between kernels and their pieces."""
Array = NDArray[Any]
"""An array of whichever type the caller has: numba compiles the piece for each."""

Loop = TypeVar("Loop", bound=Callable[..., Any])
Made = TypeVar("Made")


def kernel(function: Loop) -> Loop:
    """Decorator of what is called from Python: compiled at its first call, then kept on disk.

    numba keeps it in the first of these that can be written: NUMBA_CACHE_DIR, `__pycache__` next to the file, the user's cache.
    Warns once where none can; the kernel works all the same.
    """
    dispatcher = compiled(function, nogil=True)
    if vars(config)["DISABLE_JIT"]:
        return dispatcher
    try:
        cast(Any, dispatcher)._cache = KernelCache(function)
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        warn_not_kept()
        _LISTENER.announced = True  # the warning says it already
    return dispatcher


def compiled(function: Loop, **options: bool) -> Loop:
    """numba's `njit` as all of dlama uses it: division by zero gives inf or nan as in numpy, and nothing can be called from C.

    Without `_nrt` nothing can be allocated, and references to arrays are not counted at every call of a piece: the ray caster
    takes half the time so.
    """
    return cast("Loop", cast(Any, njit)(error_model="numpy", no_cfunc_wrapper=True, _nrt=False, **options)(function))


def piece(function: Loop) -> Loop:
    """Decorator of what kernels are made of: stored as a part of them, cannot be called from Python."""
    return compiled(function, no_cpython_wrapper=True)


def inlined(function: Loop) -> Loop:
    """As `piece`, for what is handed several arrays for every pixel: the call would cost more than the work."""
    return compiled(function, no_cpython_wrapper=True, forceinline=True)


class _Compiling(Listener):
    """While a kernel of dlama is being compiled the garbage collector waits; the first one of the process is announced.

    numba makes millions of objects that live as long as the compilation: collecting takes a sixth of its time and frees little.
    """

    def __init__(self) -> None:
        self.lock, self.running, self.collecting, self.announced = threading.Lock(), 0, True, False

    def on_start(self, event: Event) -> None:
        if not is_ours(event):
            return
        with self.lock:
            if not self.running:
                self.collecting = gc.isenabled()
                gc.disable()
            self.running += 1
            first, self.announced = not self.announced, True
        if first:
            LOG.info(COMPILING)

    def on_end(self, event: Event) -> None:
        if not is_ours(event):
            return
        with self.lock:
            self.running -= 1
            if not self.running and self.collecting:
                gc.enable()


def is_ours(event: Event) -> bool:
    """True if it is a function of dlama that numba compiles, not one of its own or of the caller's."""
    return str(event.data["dispatcher"].py_func.__module__).startswith("dlama.")


_LISTENER = _Compiling()
register("numba:compile", _LISTENER)


_thread = threading.local()
"""`at_work`: whether a band is being run in this thread."""
_LOADING = threading.RLock()
BAND = 32
"""Rows per task: enough of them that threads finish together, not so many that handing them out costs."""

_most_threads: list[int] = []


def use_threads(most: int) -> None:
    """Let the kernels of this process use so many threads at most: one, where processes share the cores already."""
    _most_threads[:] = [most]


def threads() -> int:
    """How many threads kernels use: `use_threads`, else NUMBA_NUM_THREADS, else the cores of this process."""
    return _most_threads[0] if _most_threads else int(vars(config)["NUMBA_NUM_THREADS"])


def in_bands(job: Callable[..., None], rows: int, *arguments: Any, band: int = BAND) -> None:
    """job(first, last, *arguments) for bands of rows that together are range(rows), in any order, on all cores.

    job: a `kernel`, which lets go of Python's lock while it runs; any function that takes (first, last, ...) will do.
    rows: how many there are of what the job counts (rows, pixels, shifts); band: how many of them are one task.
    The job writes into its arguments; what it runs in bands itself stays in its thread. Bands must not depend on each other, so
    that the result does not depend on the number of threads; an empty one, which comes first, must do nothing. What a job raises
    in any thread is raised here.
    """
    count = min(threads(), -(-rows // band))
    nested = getattr(_thread, "at_work", False)
    if count > 1 or nested:
        with _LOADING:  # compiled, or loaded, before threads call it: numba's dispatcher does not stand two at once
            job(0, 0, *arguments)
    if count < 2 or nested:
        job(0, rows, *arguments)
        return
    starts = deque(range(0, rows, band))
    # bands from both ends: a core finds in its own cache what the kernel before left there; single tasks, longest first, in order
    takes = (starts.popleft, starts.pop if band > 1 else starts.popleft)

    def work(take: Callable[[], int]) -> None:
        _thread.at_work = True
        try:
            while starts:
                try:
                    first = take()
                except IndexError:  # another thread took the last one
                    break
                job(first, min(rows, first + band), *arguments)
        finally:
            _thread.at_work = False

    others = [_pool().submit(work, takes[number % 2]) for number in range(1, count)]
    try:
        work(starts.popleft)
    finally:
        for other in others:
            if not other.cancel():  # not begun, for a job of `begin_job` has the thread: nothing is left for it
                other.result()


def as_input(array: Array) -> Array:
    """The array, contiguous and read-only: kernels are compiled anew for each layout, and for arrays that may be written to."""
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view


def light_band(columns: int) -> int:
    """Rows per task (`in_bands`) of a job that takes about a nanosecond a pixel, on rows of so many pixels: fewer are done before
    a second thread has woken up."""
    return max(BAND, 2**17 // max(1, columns))


def begin_job(job: Callable[..., Made], *arguments: Any) -> Callable[[], Made]:
    """Begin job(*arguments) in another thread, if there is one; what comes back waits for its result, and computes it where that
    thread has not begun.

    For numpy and OpenCV, which let go of Python's lock. The job's kernels stay in its thread: they must be such as nothing else
    runs meanwhile, or run by `in_bands`.
    """
    if threads() < 2 or getattr(_thread, "at_work", False):
        return functools.partial(job, *arguments)

    def work() -> Made:
        _thread.at_work = True
        try:
            return job(*arguments)
        finally:
            _thread.at_work = False

    begun = _pool().submit(work)
    return lambda: job(*arguments) if begun.cancel() else begun.result()


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, threads() - 1), "dlama")


if hasattr(os, "register_at_fork"):  # threads do not survive a fork: the child makes its own
    os.register_at_fork(after_in_child=_pool.cache_clear)
