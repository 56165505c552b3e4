"""Tasks and a number of processes in; the outcomes of every task out, as they end, even where single processes die."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from dlama.evaluation.runner.worker import Outcome, Task, work, work_all
from dlama.files.drafts import remove_abandoned
from dlama.workers.pool import run_all


def run_tasks(tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """Of every task. When a process dies, the case it had runs again; one that ends its process again fails."""
    if jobs == 1 or len(tasks) <= 1:
        for task in tasks:
            yield from work(task)
        return
    try:
        for ended in run_all(work_all, tasks, min(jobs, len(tasks))):
            yield from _fail_task(ended.task) if ended.died else ended.answer
    except BaseException:  # Ctrl-C: files are written whole or not at all, so nobody has to be waited for
        for folder in {task.folder for task in tasks}:
            for name in ("cases", "panels"):
                remove_abandoned(folder / name, again=True)
        raise


def _fail_task(task: Task) -> Iterator[Outcome]:
    line = "a process died twice while it ran this case (out of memory?); fewer --jobs may help"
    yield from (Outcome(task.case, method, line) for method, _ in task.methods)
