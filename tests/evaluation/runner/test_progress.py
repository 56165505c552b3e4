"""A line a minute (oracles: lines by hand, the lines that a short interval gives)."""

from __future__ import annotations

import threading
from pathlib import Path

import made_up
from made_up import METHODS, made_up_dataset

from dlama.evaluation.protocols.methods import Method, ProtocolSettings
from dlama.evaluation.runner.progress import progress_lines
from dlama.evaluation.runner.run import run


def test_lines_come_while_a_case_is_under_way(tmp_path: Path) -> None:
    """Law: a case that waits for two lines ends only because they come; the counts are the run's own."""
    lines: list[str] = []
    two = threading.Event()

    def write(line: str) -> None:
        lines.append(line)
        if len(lines) == 2:
            two.set()

    def waits(truth: object, *words: object) -> list[object]:
        assert two.wait(600)
        return []

    dataset = made_up_dataset(1, (10.0,))
    with progress_lines("toy", write, every=0.01) as progress:
        done = run(dataset.cases, METHODS[:1], {"vpi": waits}, ProtocolSettings(), tmp_path, progress=progress)  # type: ignore[dict-item]
    assert len(done.stored) == 1 and lines[1].startswith("toy: 0 of 1 done (0 %), running for ")


def test_failures_are_counted_and_the_thread_ends(tmp_path: Path) -> None:
    """Oracle: the run's own failures; no thread is left, and no line comes after the end."""
    before, lines = threading.active_count(), []
    written = threading.Event()

    def write(line: str) -> None:
        lines.append(line)
        if line.startswith("toy: 2 of 2"):
            written.set()

    dataset, methods = made_up_dataset(1, (10.0,)), (METHODS[0], Method("paper", "bad"))
    with progress_lines("toy", write, every=0.01) as progress:
        run(dataset.cases, methods, {"vpi": made_up.protocol}, ProtocolSettings(), tmp_path, progress=progress)
        assert written.wait(600)
    count = len(lines)
    assert "toy: 2 of 2 done (100 %), " in lines[-1] and lines[-1].endswith(", 1 failed")
    assert threading.active_count() == before
    threading.Event().wait(0.05)
    assert len(lines) == count
