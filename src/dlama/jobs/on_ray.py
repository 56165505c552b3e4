"""A Ray cluster in; workers on its nodes that run tasks as `dlama.workers.pool.Pool` does on this computer, out.

Ray is the scheduler: it places one actor a worker, starts one elsewhere when one is lost, and says which node died. Each actor
keeps its networks and kernels open and runs one task at a time. Files are read and written by the actors, on shared storage;
rows alone come back.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from dlama.errors import DlamaError, InputError, first_line, import_extra
from dlama.workers.pool import OUT_OF_MEMORY, STARTS, TaskEnd, WorkerError
from dlama.workers.threads import limit_threads

NODE_SECONDS = 30.0
"""How long a node may take to answer, after an actor on it has died; one that does not has died too."""
LOOK_SECONDS = 5.0
"""How often it is looked whether there are nodes, while nothing is answered."""
BACK_SECONDS = 120.0
"""How long a cluster without any node that can run a worker is waited for."""
NODE_DIED = "node has died"
"""What Ray says of an actor that went with its node."""


class _Actor:
    """What runs on a node. Ray makes an actor of it."""

    def __init__(self, work: Callable[[Any], Any], threads: int) -> None:
        limit_threads(threads)
        self.work = work

    def node(self) -> str:
        """Where it is; answered when it is ready."""
        import ray

        return str(ray.get_runtime_context().get_node_id())

    def run(self, task: Any) -> Any:
        """One task."""
        try:
            return self.work(task)
        except MemoryError:
            os._exit(OUT_OF_MEMORY)


def _answer() -> bool:
    """What a node that is alive answers."""
    return True


@dataclass(eq=False)
class _Worker:
    handle: Any
    answer: Any
    """To come: its node's name, where it is not ready yet, else the result of its task; None: it has none."""
    node: str = ""
    """Empty: it is not ready."""
    task: Any = None


class RayWorkers:
    """Actors that each run one task at a time. To be closed."""

    def __init__(
        self, work: Callable[[Any], Any], address: str, workers: int | None, threads: int | None, gpus_per_worker: float
    ) -> None:
        """address: local (a cluster of this computer alone), auto (the one that this node belongs to), or HOST:PORT.

        Raises MissingExtraError: Ray is not installed; InputError: no such cluster, or one without room for a worker.
        """
        self.ray = _ray()
        self._started = _connect(self.ray, address)
        self.work, self.threads, self.gpus = work, threads or 1, gpus_per_worker
        room = self._room()
        if room < 1:
            self.close()
            raise InputError(
                f"`ray={address}` has no room for a worker: {self.ray.cluster_resources()}; fewer threads or a smaller "
                "`gpus_per_worker` is expected"
            )
        self.count = workers or room
        self._workers: list[_Worker] = []
        self._failed_starts = 0
        for _ in range(self.count):
            self._start()

    @property
    def free(self) -> int:
        """How many tasks can be handed in now."""
        return sum(one.answer is None for one in self._workers)

    def submit(self, task: Any) -> None:
        """Hand in a task; only while one is `free`."""
        worker = next(one for one in self._workers if one.answer is None)
        worker.answer, worker.task = worker.handle.run.remote(task), task

    def wait(self) -> list[TaskEnd]:
        """The tasks that ended; none, where an actor has become ready."""
        owners = {one.answer: one for one in self._workers if one.answer is not None}
        self._wait_for_one(list(owners))
        done, _ = self.ray.wait(list(owners), num_returns=len(owners), timeout=0)
        return [end for answer in done for end in self._receive(owners[answer])]

    def close(self) -> None:
        """End all actors, and the cluster if it was started for them."""
        for worker in getattr(self, "_workers", []):
            self.ray.kill(worker.handle)
        if self._started:
            self.ray.shutdown()

    def _wait_for_one(self, answers: list[Any]) -> None:
        """Until one of the answers is there. DlamaError: no node can run a worker any more, and none came for BACK_SECONDS."""
        lost_at = None
        while not self.ray.wait(answers, num_returns=1, timeout=LOOK_SECONDS)[0]:
            if self._room() >= 1:
                lost_at = None
                continue
            lost_at = lost_at or time.monotonic()
            if time.monotonic() - lost_at >= BACK_SECONDS:
                raise DlamaError(
                    f"ray: no node of the cluster can run a worker, and none came back within {BACK_SECONDS:g} s; "
                    "what is done is kept, and the same command resumes it"
                )

    def _room(self) -> int:
        """How many workers the cluster holds."""
        has = self.ray.cluster_resources()
        room = int(has.get("CPU", 0) // self.threads)
        return min(room, int(has.get("GPU", 0) / self.gpus)) if self.gpus else room

    def _start(self) -> None:
        made = self.ray.remote(_Actor).options(num_cpus=self.threads, num_gpus=self.gpus, max_restarts=0)
        handle = made.remote(self.work, self.threads)
        self._workers.append(_Worker(handle, handle.node.remote()))

    def _receive(self, worker: _Worker) -> list[TaskEnd]:
        """The answer of an actor; where it has died, its task is to blame unless the whole node has died. WorkerError: actors
        cannot start, as on nodes without dlama."""
        was_ready, node = bool(worker.node), worker.node
        try:
            answer = self.ray.get(worker.answer)
        except self.ray.exceptions.RayActorError as error:
            self._workers.remove(worker)
            self._failed_starts += not was_ready and NODE_DIED not in str(error)
            if self._failed_starts >= STARTS:
                raise WorkerError(f"ray: workers end while they start ({' '.join(str(error).split())})") from error
            self._start()
            blameless = self._node_died(node, str(error))
            how = "its node died" if blameless else first_line(error)
            return [TaskEnd(worker.task, died=how, blameless=blameless)] if was_ready else []
        worker.node, worker.answer, self._failed_starts = node or answer, None, 0
        return [TaskEnd(worker.task, answer)] if was_ready else []

    def _node_died(self, node: str, message: str) -> bool:
        """Ask the node itself: its cluster may take long to notice that it has died with its actors."""
        if not node or NODE_DIED in message:
            return True
        there = self.ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(node, soft=False)
        asked = self.ray.remote(_answer).options(num_cpus=0, max_retries=0, scheduling_strategy=there).remote()
        try:
            return not self.ray.get(asked, timeout=NODE_SECONDS)
        except (self.ray.exceptions.RayError, self.ray.exceptions.GetTimeoutError):
            return True


def _connect(ray: Any, address: str) -> bool:
    """Whether a cluster was joined or started here, and is to be left at the end."""
    if ray.is_initialized():
        return False
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    options: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    try:
        if address == "local":
            ray.init(address="local", include_dashboard=False, **options)
            return True
        _check_answers(address)
        ray.init(address=address, **options)
    except Exception as error:  # a node that does not start in time is a bare Exception
        if address == "local":
            raise DlamaError(f"`ray=local`: no cluster could be started here ({first_line(error)})") from error
        raise InputError(
            f"`ray={address}`: no such cluster ({first_line(error)}); local, auto or HOST:PORT is expected"
        ) from error
    return True


def _check_answers(address: str) -> None:
    """OSError or ValueError where HOST:PORT takes no connection: Ray itself would try for minutes."""
    host, colon, port = address.rpartition(":")
    if colon and "://" not in address:
        socket.create_connection((host.strip("[]"), int(port)), timeout=10).close()


def _ray() -> Any:
    for name in ("ray.exceptions", "ray.util.scheduling_strategies"):
        import_extra(name, "a Ray cluster", "ray", "batch")
    return import_extra("ray", "a Ray cluster", "ray", "batch")
