"""Workers of batches that need no process of their own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from dlama.jobs import batch
from dlama.workers.pool import TaskEnd


class InThisProcess:
    """Stands for `dlama.workers.pool.Pool`: one task at a time, done when it is waited for."""

    count = 1

    def __init__(self, work: Callable[[Any], Any]) -> None:
        self.work, self.tasks = work, list[Any]()

    @property
    def free(self) -> int:
        return self.count - len(self.tasks)

    def submit(self, task: Any) -> None:
        self.tasks.append(task)

    def wait(self) -> list[TaskEnd]:
        task = self.tasks.pop()
        return [TaskEnd(task, self.work(task))]

    def close(self) -> None:
        self.tasks = []


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Batches run their jobs here: starting processes takes most of the time of small ones (tests/workers has these)."""
    monkeypatch.setattr(batch, "worker_starter", lambda *_: lambda: InThisProcess(batch.work))
