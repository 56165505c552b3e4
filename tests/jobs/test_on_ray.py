"""A cluster of several nodes on this computer (oracles: the same list on processes, byte for byte; the list itself)."""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from ray_run import NO_CLUSTER
from small_jobs import FAST, FLAG, contents, table, view_rows, write_csv

from box_frame import small_frame
from dlama.errors import DlamaError, InputError, MissingExtraError
from dlama.jobs import on_ray
from dlama.jobs.batch import batch
from dlama.jobs.on_ray import _connect
from dlama.jobs.results.result import JobResult
from dlama.workers.pool import WorkerError

with_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="ray is not installed: extra `batch`")

on_request = pytest.mark.skipif("DLAMA_CLUSTER" not in os.environ, reason="takes a minute: DLAMA_CLUSTER=1 runs it")


@with_ray
@on_request
@pytest.mark.slow
def test_a_lost_node_and_lost_workers_lose_no_job(tmp_path: Path) -> None:
    """One node is killed in the middle, one job kills its worker once, another always: all rows are there, none twice, and
    results are those of local processes."""
    rows = view_rows(12)
    rows[4:4] = [{**rows[0], "id": name} for name in ("killed-1", "killed-9")]
    path = write_csv(small_frame(tmp_path) / "jobs.csv", rows)
    environment = {**os.environ, FLAG: str(tmp_path), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    words = [sys.executable, str(Path(__file__).with_name("ray_run.py")), str(path), str(tmp_path / "out"), "3"]
    done = subprocess.run(words, capture_output=True, text=True, env=environment, timeout=600)
    if done.returncode == NO_CLUSTER:
        pytest.skip(f"Ray's own processes did not start: {done.stderr[-200:]}")
    seen = [JobResult.from_json(line[4:]) for line in done.stdout.splitlines() if line.startswith("row ")]
    assert sorted(row.id for row in seen) == sorted(str(row["id"]) for row in rows), done.stderr[-2000:]
    failures = {row.id: row for row in seen if row.status == "failed"}
    assert set(failures) == {"killed-9"} and failures["killed-9"].error_kind == "WorkerDied"
    assert list(table(tmp_path / "out")) == [row["id"] for row in rows]
    alive = write_csv(tmp_path / "local.csv", [row for row in rows if row["id"] != "killed-9"])
    assert {row.status for row in batch(alive, tmp_path / "local", workers=1, **FAST)} == {"done"}
    ours, local = contents(tmp_path / "out"), contents(tmp_path / "local")
    assert list(ours) == list(local)
    assert [name for name in ours if ours[name] != local[name]] == []


@with_ray
@on_request
@pytest.mark.slow
def test_a_run_whose_only_node_dies_ends_and_is_resumed(tmp_path: Path) -> None:
    """Killed after four of twenty results: an error, its exit code and what resumes; the same command then does the rest
    (oracle: the list)."""
    rows = view_rows(20)
    path = write_csv(small_frame(tmp_path) / "jobs.csv", rows)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}

    def run(before: int) -> subprocess.CompletedProcess[str]:
        words = [sys.executable, str(Path(__file__).with_name("ray_death.py")), str(path), str(tmp_path / "out")]
        return subprocess.run([*words, str(before)], capture_output=True, text=True, env=environment, timeout=300)

    died = run(4)
    if "no cluster could be started here" in died.stderr:
        pytest.skip(f"Ray's own processes did not start: {died.stderr[-200:]}")
    assert died.returncode == 2, died.stderr[-2000:]
    (error,) = [line for line in died.stderr.splitlines() if line.startswith("error: ")]
    assert "no node of the cluster can run a worker" in error and "the same command resumes it" in error
    before = [row["id"] for row in table(tmp_path / "out").values() if row["status"] == "done"]
    assert 4 <= len(before) < 20
    resumed = run(1000)
    assert resumed.returncode == 0, resumed.stderr[-2000:]
    assert {row["id"]: row["status"] for row in table(tmp_path / "out").values()} == {row["id"]: "done" for row in rows}


def test_without_ray_the_pip_line_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything is run (oracle: the message)."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"ray=local needs the package 'ray': pip install 'dlama\[batch\]'"):
        batch([], "out", ray="local")
    with pytest.raises(InputError, match=r"gpus_per_worker is 0\.5 without ray"):
        batch([], "out", gpus_per_worker=0.5)


@with_ray
def test_numbers_that_cannot_be() -> None:
    """Before a cluster is started."""
    with pytest.raises(InputError, match="workers is 0"):
        batch([], "out", ray="local", workers=0)
    with pytest.raises(InputError, match="gpus_per_worker is -1"):
        batch([], "out", ray="local", gpus_per_worker=-1)


def test_a_cluster_that_is_not_there_is_reported_at_once() -> None:
    """Law: HOST:PORT that takes no connection ends before Ray tries for minutes; so does what is no port."""
    no_ray = SimpleNamespace(is_initialized=lambda: False)
    with socket.create_server(("127.0.0.1", 0)) as server:
        free = server.getsockname()[1]
    for address in (f"127.0.0.1:{free}", "127.0.0.1:port"):
        with pytest.raises(
            InputError, match=rf"ray={address}: no such cluster .*; local, auto or HOST:PORT is expected"
        ):
            _connect(no_ray, address)


class Lost:
    """A cluster that answers nothing and has no node, but for the looks in `back`."""

    def __init__(self, back: set[int]) -> None:
        self.back, self.looks = back, 0

    def wait(self, refs: list[Any], *, num_returns: int, timeout: float | None = None) -> tuple[list[Any], list[Any]]:
        """Nothing, at once; it is never waited for without a limit."""
        assert timeout is not None
        self.looks += 1
        return ([refs[0]], refs[1:]) if self.looks > 8 else ([], refs)

    def cluster_resources(self) -> dict[str, float]:
        """None, or room for one worker."""
        return {"CPU": 1.0} if self.looks in self.back else {"node:head": 1.0}


def test_a_cluster_without_nodes_ends_with_the_line_that_resumes(monkeypatch: pytest.MonkeyPatch) -> None:
    """After BACK_SECONDS without one; a node that comes back in between begins the time anew (oracle: the clock's own ticks)."""
    clock = iter(range(0, 10_000, 25))
    monkeypatch.setattr(on_ray.time, "monotonic", lambda: float(next(clock)))
    for back, ends in ((set(), True), ({3, 6}, False)):
        workers = object.__new__(on_ray.RayWorkers)
        workers.ray, workers.threads, workers.gpus = Lost(back), 1, 0.0  # type: ignore[assignment]
        if ends:
            with pytest.raises(DlamaError, match=r"none came back within 120 s; what is done is kept, .* resumes it"):
                workers._wait_for_one(["a"])
        else:
            workers._wait_for_one(["a"])
            assert workers.ray.looks == 9


def test_actors_that_cannot_start_end_the_run() -> None:
    """Law: on nodes without dlama they were started again and again without a word. One that starts begins the count anew, one
    that goes with its node does not count."""
    errors = {"dead": "The actor died: No module named 'dlama'", "lost": "its node has died"}

    class Cluster(Lost):
        exceptions = SimpleNamespace(RayActorError=RuntimeError)

        def get(self, answer: str) -> str:
            if answer in errors:
                raise RuntimeError(errors[answer])
            return answer

    def receive(*answers: str) -> None:
        workers = object.__new__(on_ray.RayWorkers)
        workers.ray, workers._failed_starts = Cluster(set()), 0  # type: ignore[assignment]
        workers._start = lambda: None  # type: ignore[method-assign]
        for answer in answers:
            workers._workers = [on_ray._Worker(None, answer)]
            assert workers._receive(workers._workers[0]) == []

    receive("dead", "dead", "node", "dead", "dead", "lost", "lost")
    with pytest.raises(WorkerError, match=r"ray: workers end while they start .*No module named 'dlama'"):
        receive("dead", "dead", "lost", "dead")
