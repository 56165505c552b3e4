"""Tasks and a number of processes in; the outcomes of every task out, as they end, whatever happens to single processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from dlama.evaluation.runner.worker import THREAD_VARIABLES, Outcome, Task, one_thread, work, work_all
from dlama.files.drafts import remove_abandoned


def outcomes(tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """Of every task. When a process dies, the cases under way run again, one at a time; one that ends its process again fails."""
    if jobs == 1 or len(tasks) <= 1:
        for task in tasks:
            yield from work(task)
        return
    waiting = list(tasks)
    with _one_thread_each():
        while waiting:
            suspects: list[Task] = []
            yield from _pooled(waiting, min(jobs, len(waiting)), suspects)
            for task in suspects:
                lost: list[Task] = []
                yield from _pooled([task], 1, lost)
                yield from _lost(lost)


def _pooled(waiting: list[Task], jobs: int, suspects: list[Task]) -> Iterator[Outcome]:
    """Take tasks off the front, as many at a time as there are processes, until all are done or a process has died: then the
    tasks under way go to `suspects`."""
    under_way: dict[Future[list[Outcome]], Task] = {}
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), initializer=one_thread)
    try:
        while (waiting or under_way) and not suspects:
            while waiting and len(under_way) < jobs:
                task = waiting.pop(0)
                try:
                    with _interrupts_held():
                        under_way[pool.submit(work_all, task)] = task
                except BrokenProcessPool:  # an idle process was killed
                    suspects.append(task)
                    break
            if under_way:
                wait(under_way, return_when=FIRST_COMPLETED)
            for future in [one for one in under_way if one.done()]:
                task = under_way.pop(future)
                try:
                    yield from future.result()
                except BrokenProcessPool:
                    suspects.append(task)
        for future, task in under_way.items():
            try:
                yield from future.result()
            except BrokenProcessPool:
                suspects.append(task)
    except BaseException:  # Ctrl-C: files are written whole or not at all, so nobody has to be waited for
        folders = {task.folder for task in (*waiting, *under_way.values(), *suspects)}
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
            child.join()
        for folder in folders:
            for name in ("cases", "panels"):
                remove_abandoned(folder / name, again=True)
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _lost(tasks: Iterable[Task]) -> Iterator[Outcome]:
    line = "a process died twice while it ran this case (out of memory?); fewer --jobs may help"
    yield from (Outcome(task.case, method, line) for task in tasks for method, _ in task.methods)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Ctrl-C waits; processes started meanwhile never get one, which would end them with a traceback while they load."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started meanwhile begin with one thread, as libraries read these variables when they are loaded."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
