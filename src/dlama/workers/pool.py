"""A function, a number of processes and tasks in; what became of each task out, also of one that killed its process.

A process that dies takes one task with it, no more, and is replaced. Processes are started by `spawn`, compute on a given
number of threads, keep what they have opened (networks, kernels) from task to task, and end with the process that started them.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from dlama.errors import DlamaError
from dlama.workers.threads import become_worker, hold_interrupts, threads_of_new_processes

OUT_OF_MEMORY = 101
"""Exit code of a worker whose task ran out of memory."""
STARTS = 3
"""Processes that may end, one after the other, before they are ready."""
TRIES = 2
"""How often a task may end its process."""


class WorkerError(DlamaError, RuntimeError):
    """Worker processes cannot be started."""


@dataclass(frozen=True)
class TaskEnd:
    """What became of a task."""

    task: Any
    answer: Any = None
    """What the function returned."""
    died: str | None = None
    """How its process ended before it could answer, in words; None: it did answer."""
    blameless: bool = False
    """It was not what the process ran when it died, or the whole computer died: that counts as no try."""


@dataclass(eq=False)
class _Worker:
    process: Any
    connection: Connection
    ready: bool = False
    task: Any = None
    busy: bool = False


class Pool:
    """Processes that each run one task at a time. To be closed; a `with` block does it."""

    def __init__(self, work: Callable[[Any], Any], count: int, threads: int = 1) -> None:
        """work: a module's function that takes a task and returns an answer, both picklable; it catches its own errors."""
        self.work, self.count, self.threads = work, count, threads
        self._workers: list[_Worker] = []
        self._failed_starts = 0

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def free(self) -> int:
        """How many tasks can be handed in now."""
        return self.count - sum(worker.busy for worker in self._workers)

    def submit(self, task: Any) -> None:
        """Hand in a task; only while one is `free`."""
        while True:
            worker = next((one for one in self._workers if not one.busy), None) or self._start()
            try:
                worker.connection.send(task)
            except (BrokenPipeError, ConnectionResetError):  # an idle process was killed
                self._forget(worker)
                continue
            worker.task, worker.busy = task, True
            return

    def wait(self) -> list[TaskEnd]:
        """The tasks that ended, at least one. WorkerError where processes cannot start."""
        ends: list[TaskEnd] = []
        while not ends:
            busy = [one for one in self._workers if one.busy]
            readable = wait([handle for one in busy for handle in (one.connection, one.process.sentinel)])
            for worker in busy:
                if worker.connection in readable or worker.process.sentinel in readable:
                    ends += self._receive(worker)
        return ends

    def close(self) -> None:
        """End all processes at once; what they were doing is left undone."""
        for worker in list(self._workers):
            worker.process.terminate()
        for worker in list(self._workers):
            self._forget(worker)

    def _start(self) -> _Worker:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, self.work, self.threads), daemon=True)
        with threads_of_new_processes(self.threads), hold_interrupts():
            process.start()
        theirs.close()
        worker = _Worker(process, ours)
        self._workers.append(worker)
        return worker

    def _receive(self, worker: _Worker) -> Iterator[TaskEnd]:
        """What a busy worker has sent; its end, if it has died."""
        try:
            if worker.connection.poll():
                answer = worker.connection.recv()
                if not worker.ready:
                    worker.ready, self._failed_starts = True, 0
                    return
                task, worker.task, worker.busy = worker.task, None, False
                yield TaskEnd(task, answer)
                return
        except (EOFError, ConnectionResetError):
            pass
        task = worker.task
        self._forget(worker)
        if worker.ready:
            yield TaskEnd(task, died=describe_exit(worker.process.exitcode))
            return
        self._failed_starts += 1
        if self._failed_starts >= STARTS:
            raise WorkerError(
                f"worker processes end while they start ({describe_exit(worker.process.exitcode)}); a script that starts some "
                'must do so under `if __name__ == "__main__":`'
            )
        self.submit(task)

    def _forget(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.process.join()
        worker.connection.close()


def run_all(work: Callable[[Any], Any], tasks: Iterable[Any], count: int) -> Iterator[TaskEnd]:
    """Every task on so many processes, as they end. One whose process dies runs again; TRIES deaths, and it is left as died."""
    known = list(tasks)  # so that no other task gets the identity of one of them
    waiting, deaths = deque(known), dict[int, int]()
    with Pool(work, count) as pool:
        under_way = 0
        while waiting or under_way:
            while waiting and pool.free:
                pool.submit(waiting.popleft())
                under_way += 1
            for ended in pool.wait():
                under_way -= 1
                key = id(ended.task)
                deaths[key] = deaths.get(key, 0) + (ended.died is not None)
                if ended.died is not None and deaths[key] < TRIES:
                    waiting.appendleft(ended.task)
                else:
                    yield ended


def _serve(connection: Connection, work: Callable[[Any], Any], threads: int) -> None:
    """The life of a worker process."""
    become_worker(threads)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        connection.send(True)
        while True:
            task = connection.recv()
            try:
                answer = work(task)
            except MemoryError:
                os._exit(OUT_OF_MEMORY)
            connection.send(answer)


def describe_exit(code: int | None) -> str:
    """An exit code in words."""
    if code == OUT_OF_MEMORY:
        return "out of memory"
    if code is not None and code < 0:
        with contextlib.suppress(ValueError):
            name = signal.Signals(-code).name
            return f"killed by {name}{', perhaps as memory ran out' if name == 'SIGKILL' else ''}"
    return f"exit code {code}"
