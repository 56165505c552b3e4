"""How much is done, in a line (oracle: lines by hand), and while a task is under way (law: it ends only because lines come)."""

from __future__ import annotations

import threading

from dlama.workers.progress import duration, progress_line, write_line_every


def test_lines_by_hand() -> None:
    """12 of which 2 were there: 10 in 200 s are 3 a minute, and 228 more take 76 minutes."""
    line = progress_line("street", kept=2, done=12, total=240, failed=0, seconds=200)
    assert line == "street: 12 of 240 done (5 %), 3.0 a minute, 1 h 16 min left"
    line = progress_line("street", kept=12, done=12, total=240, failed=0, seconds=61)
    assert line == "street: 12 of 240 done (5 %), running for 1 min"
    line = progress_line("street", kept=0, done=240, total=240, failed=3, seconds=60)
    assert line == "street: 240 of 240 done (100 %), 240.0 a minute, 0 s left, 3 failed"
    assert [duration(one) for one in (0, 59, 59.7, 3569, 3600, 11100)] == [
        "0 s",
        "59 s",
        "1 min",
        "59 min",
        "1 h 00 min",
        "3 h 05 min",
    ]


def test_lines_come_while_a_task_is_under_way() -> None:
    """No thread is left, and no line comes after the end."""
    before, lines, two = threading.active_count(), list[str](), threading.Event()

    def write(line: str) -> None:
        lines.append(line)
        if len(lines) == 2:
            two.set()

    with write_line_every(lambda seconds: f"{seconds:.0f} s", write, every=0.01):
        assert two.wait(600)
    count = len(lines)
    assert threading.active_count() == before
    threading.Event().wait(0.05)
    assert len(lines) == count
