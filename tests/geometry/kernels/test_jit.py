"""Compiling kernels and running them in bands of rows.

Oracles: every row once, exceptions seen, a child process that has no threads yet; folders that cannot be written; numba's events.
"""

from __future__ import annotations

import errno
import functools
import gc
import importlib.util
import logging
import multiprocessing
import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import numba
import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile
from numba.core.event import Event, Listener, install_listener

from dlama.geometry.kernels import jit, stored
from dlama.geometry.kernels.jit import begin_job, in_bands


def count(first: int, last: int, out: np.ndarray) -> None:
    out[first:last] += 1


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("rows", [0, 1, 31, 32, 33, 200])
def test_every_row_is_done_once(rows: int, threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: each band adds one to its rows; with any number of threads all are one."""
    monkeypatch.setattr(jit, "threads", lambda: threads)
    out = np.zeros(rows, int)
    in_bands(count, rows, out)
    assert (out == 1).all()


def test_bands_inside_a_band_stay_in_its_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: each of five rows of bands adds one to its cells, all in the thread of its row; nobody waits for a free thread."""
    monkeypatch.setattr(jit, "threads", lambda: 2)
    out, ran = np.zeros((5, 100), int), [set[int]() for _ in range(5)]

    def add(first: int, last: int, row: int) -> None:
        out[row, first:last] += 1
        ran[row].add(threading.get_ident())

    def each(first: int, last: int) -> None:
        for row in range(first, last):
            in_bands(add, 100, row)

    in_bands(each, 5, band=1)
    assert (out == 1).all() and {len(one) for one in ran} == {1}


def test_what_goes_wrong_in_another_thread_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    """A job that fails in whichever thread runs the last band fails the caller."""
    monkeypatch.setattr(jit, "threads", lambda: 2)
    ready = threading.Barrier(2)

    def fail(first: int, last: int) -> None:
        if last > first:
            ready.wait(timeout=600)
        if first:
            raise ArithmeticError("second band")

    with pytest.raises(ArithmeticError, match="second band"):
        in_bands(fail, 64)


def test_a_job_that_was_begun_leaves_bands_to_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: while a job has the other thread, bands end without it, and a second job is done by whoever waits for it; its
    caller sees what a job raises."""
    monkeypatch.setattr(jit, "threads", lambda: 2)
    monkeypatch.setattr(jit, "_pool", functools.cache(lambda: ThreadPoolExecutor(1)))
    out, go = np.zeros(100, int), threading.Event()
    first, second = begin_job(go.wait, 600), begin_job(threading.get_ident)
    in_bands(count, 100, out)
    assert (out == 1).all() and second() == threading.get_ident()
    go.set()
    assert first()
    with pytest.raises(ZeroDivisionError):
        begin_job(divmod, 1, 0)()


def test_one_thread_alone_compiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first call of all has no rows and is over before any other begins: two at once break numba's dispatcher."""
    monkeypatch.setattr(jit, "threads", lambda: 3)
    calls: list[tuple[int, int]] = []
    in_bands(lambda first, last: calls.append((first, last)), 100)
    assert calls[0] == (0, 0)
    assert sorted(calls[1:]) == [(0, 32), (32, 64), (64, 96), (96, 100)]


def test_a_process_that_shares_the_cores_uses_fewer_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """`use_threads` overrules numba's setting."""
    monkeypatch.setattr(jit, "_most_threads", [])
    before = jit.threads()
    jit.use_threads(before + 1)
    assert jit.threads() == before + 1


def child(queue: multiprocessing.Queue) -> None:
    out = np.zeros(100, int)
    in_bands(count, 100, out)
    queue.put(int(out.sum()))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_child_makes_its_own_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """The parent's threads do not survive a fork: a child that waited for them would wait for ever."""
    monkeypatch.setattr(jit, "threads", lambda: 2)
    in_bands(count, 100, np.zeros(100, int))
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=child, args=(queue,))
    process.start()
    assert queue.get(timeout=600) == 100
    process.join(timeout=600)
    assert process.exitcode == 0


TWO_KERNELS = """
from dlama.geometry.kernels.jit import kernel

@kernel
def double(values):
    for i in range(len(values)):
        values[i] *= 2

@kernel
def triple(values):
    for i in range(len(values)):
        values[i] *= 3
"""


def imported_from(folder: Path) -> ModuleType:
    """TWO_KERNELS, imported anew from a file in that folder."""
    file = folder / "two_kernels.py"
    file.write_text(TWO_KERNELS)
    spec = importlib.util.spec_from_file_location("two_kernels", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def without_cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither NUMBA_CACHE_DIR nor the user's cache can be written (they lie inside of a file, which stops root too)."""
    (tmp_path / "file").touch()
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "file" / "numba"))
    for name in ("XDG_CACHE_HOME", "HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, str(tmp_path / "file"))
    stored.warn_not_kept.cache_clear()


@pytest.mark.usefixtures("without_cache_folder")
def test_where_nothing_can_be_written_kernels_work_and_one_warning_says_so(tmp_path: Path) -> None:
    """A package folder that cannot be written either: `__pycache__` is a file there. One warning for two kernels."""
    (tmp_path / "__pycache__").touch()
    with pytest.warns(UserWarning, match=r"cannot be kept.*NUMBA_CACHE_DIR") as warned:
        module = imported_from(tmp_path)
    assert len(warned) == 1
    values = np.ones(3)
    module.double(values)
    module.triple(values)
    assert (values == 6).all()


@pytest.mark.usefixtures("without_cache_folder")
def test_compiled_kernels_lie_next_to_the_package_where_that_can_be_written(tmp_path: Path) -> None:
    """No warning (warnings are errors here), and a file of machine code after the first call."""
    imported_from(tmp_path).double(np.ones(3))
    assert list((tmp_path / "__pycache__").glob("two_kernels.double*.nbc"))


@pytest.mark.usefixtures("without_cache_folder")
@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_files_of_kernels_that_a_crash_left_empty_are_written_again(tmp_path: Path, kind: str) -> None:
    """Oracle: the kernel's result, and a whole file afterwards; no warning (warnings are errors here)."""
    imported_from(tmp_path).double(np.ones(3))
    (file,) = (tmp_path / "__pycache__").glob(f"two_kernels.double*.{kind}")
    file.write_bytes(b"")
    values = np.ones(3)
    imported_from(tmp_path).double(values)
    assert (values == 2).all() and file.stat().st_size > 0


@pytest.mark.usefixtures("without_cache_folder")
def test_where_the_disk_is_full_kernels_work_and_a_warning_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The result is right, and no index is left that names a file which is not the kernel's."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(IndexDataCacheFile, "_save_data", full)
    values = np.ones(3)
    with pytest.warns(UserWarning, match=r"cannot be kept.*the disk is full"):
        imported_from(tmp_path).double(values)
    assert (values == 2).all() and not list((tmp_path / "__pycache__").glob("*.nbi"))


class Collecting(Listener):
    """Is the garbage collector at work when numba begins and ends?"""

    def __init__(self) -> None:
        self.seen: list[bool] = []

    def on_start(self, event: Event) -> None:
        self.seen.append(gc.isenabled())

    def on_end(self, event: Event) -> None:
        self.seen.append(gc.isenabled())


@pytest.mark.parametrize("ours", [True, False])
def test_the_first_kernel_compiled_is_announced_and_garbage_waits(
    ours: bool, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two kernels, one line; functions of the caller's own are neither announced nor do they stop the collector."""

    def add(values):  # type: ignore[no-untyped-def]
        for i in range(len(values)):
            values[i] += 1

    add.__module__ = "dlama.somewhere" if ours else "somewhere"
    monkeypatch.setattr(jit._LISTENER, "announced", False)
    collecting = Collecting()
    with caplog.at_level(logging.INFO, "dlama.kernels"), install_listener("numba:compile", collecting):
        compiled = numba.njit(add)
        compiled(np.ones(3))
        compiled(np.ones(3, np.float32))
        compiled(np.ones(3))
    said = [record.getMessage() for record in caplog.records if record.name == "dlama.kernels"]
    assert said == ([jit.COMPILING] if ours else [])
    assert collecting.seen[::2] == [not ours, not ours]
    assert gc.isenabled()


@pytest.mark.slow
def test_kernels_without_compilation_are_said() -> None:
    """One warning; without the variable there is none, or no test here would pass."""
    line = [sys.executable, "-c", "import dlama.geometry.kernels.jit"]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0 and done.stderr.count("UserWarning: NUMBA_DISABLE_JIT is set") == 1
