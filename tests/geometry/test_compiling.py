"""Running kernels in bands of rows (oracles: every row once, exceptions seen, a child process that has no threads yet)."""

from __future__ import annotations

import multiprocessing
import sys
import threading

import numpy as np
import pytest

from dlama.geometry.kernels import jit as compiling
from dlama.geometry.kernels.jit import in_bands


def count(first: int, last: int, out: np.ndarray) -> None:
    out[first:last] += 1


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("rows", [0, 1, 31, 32, 33, 200])
def test_every_row_is_done_once(rows: int, threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: each band adds one to its rows; with any number of threads all are one."""
    monkeypatch.setattr(compiling, "threads", lambda: threads)
    out = np.zeros(rows, int)
    in_bands(count, rows, out)
    assert (out == 1).all()


def test_what_goes_wrong_in_another_thread_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    """A job that fails in whichever thread runs the last band fails the caller."""
    monkeypatch.setattr(compiling, "threads", lambda: 2)
    ready = threading.Barrier(2)

    def fail(first: int, last: int) -> None:
        if last > first:
            ready.wait(timeout=10)
        if first:
            raise ArithmeticError("second band")

    with pytest.raises(ArithmeticError, match="second band"):
        in_bands(fail, 64)


def test_one_thread_alone_compiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first call of all has no rows and is over before any other begins: two at once break numba's dispatcher."""
    monkeypatch.setattr(compiling, "threads", lambda: 3)
    calls: list[tuple[int, int]] = []
    in_bands(lambda first, last: calls.append((first, last)), 100)
    assert calls[0] == (0, 0)
    assert sorted(calls[1:]) == [(0, 32), (32, 64), (64, 96), (96, 100)]


def child(queue: multiprocessing.Queue) -> None:
    out = np.zeros(100, int)
    in_bands(count, 100, out)
    queue.put(int(out.sum()))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_child_makes_its_own_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """The parent's threads do not survive a fork: a child that waited for them would wait for ever."""
    monkeypatch.setattr(compiling, "threads", lambda: 2)
    in_bands(count, 100, np.zeros(100, int))
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=child, args=(queue,))
    process.start()
    assert queue.get(timeout=20) == 100
    process.join(timeout=20)
    assert process.exitcode == 0
