"""Small job lists on a made-up frame; a `work` that ends its process on request, importable by name."""

from __future__ import annotations

import csv
import json
import os
import signal
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from dlama.jobs import perform
from dlama.jobs.perform import Task
from dlama.jobs.results.result import JobResult
from dlama.workers.pool import TaskEnd

FAST: dict[str, Any] = {"fov": 60, "filler": "telea", "only": "image,depth"}
FLAG = "DLAMA_TEST_FLAG"
"""Environment variable: a folder; a job whose id is killed-N ends its process until N files lie in it."""


def view_rows(count: int) -> list[dict[str, Any]]:
    """Views from several yaws."""
    return [
        {"id": f"v/{n:03d}", "verb": "view", "image": "image.png", "depth": "depth.png", "yaw": 2 + n % 7}
        for n in range(count)
    ]


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """A list of these rows; columns are all names that occur."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, names)
        writer.writeheader()
        writer.writerows(rows)
    return path


def table(out: Path) -> dict[str, dict[str, str]]:
    """OUT/manifest.csv by id; ids differ."""
    with (out / "manifest.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len({row["id"] for row in rows}) == len(rows)
    return {row["id"]: row for row in rows}


def contents(folder: Path) -> dict[str, bytes]:
    """All files of the results below a folder, by relative path; of meta.json what is the same on every run."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and not name.startswith(("manifest", "report.html")):
            found[name] = path.read_bytes()
            if path.name == "meta.json":
                meta = json.loads(path.read_text())
                meta.pop("seconds")
                found[name] = json.dumps(meta, sort_keys=True).encode()
    return found


def deadly_work(task: Task) -> JobResult:
    """`work`, but a job called killed-N... kills its process the first N times, one called memory-... runs out of memory."""
    name = task.job.id.rpartition("/")[2]
    if name.startswith("killed-"):
        folder = Path(os.environ[FLAG])
        begun = len(list(folder.glob(f"{name}.*")))
        if begun < int(name.split("-")[1]):
            (folder / f"{name}.{begun}").touch()
            os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("memory-"):
        raise MemoryError
    return perform.work(task)


class InThisProcess:
    """Stands for `dlama.workers.pool.Pool`: one task at a time, done when it is waited for.

    A job whose id is among `deaths` ends its process so often before it is done.
    """

    count = 1

    def __init__(self, work: Callable[[Any], Any], deaths: Mapping[str, int] | None = None) -> None:
        self.work, self.deaths, self.tasks = work, deaths or {}, list[Any]()

    @property
    def free(self) -> int:
        return self.count - len(self.tasks)

    def submit(self, task: Any) -> None:
        self.tasks.append(task)

    def wait(self) -> list[TaskEnd]:
        task = self.tasks.pop()
        if task.attempt <= self.deaths.get(task.job.id, 0):
            return [TaskEnd(task, died="killed by SIGKILL")]
        return [TaskEnd(task, self.work(task))]

    def close(self) -> None:
        self.tasks = []
