"""How much is done, in a line (oracle: lines by hand; tests/evaluation/runner has a run that waits for them)."""

from __future__ import annotations

from dlama.workers.progress import duration, progress_line


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
