"""Memory of processes, and how many a computer holds (oracles: a block of known size, messages by hand)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.errors import InputError
from dlama.workers import memory


@pytest.mark.parametrize(
    "jobs, cores, free, message",
    [
        (0, 8, None, "jobs is 0; 1 or more is expected"),
        (9999, 8, None, "jobs is 9999; this computer has 8 processor cores, so at most 8 is expected"),
        (64, 64, 4e9, "as many processes take at least 19.2 GB of memory, 4.0 GB are free, so at most 13 is expected"),
    ],
)
def test_more_processes_than_the_computer_holds_are_refused(
    monkeypatch: pytest.MonkeyPatch, jobs: int, cores: int, free: float | None, message: str
) -> None:
    monkeypatch.setattr(memory, "processor_count", lambda: cores)
    monkeypatch.setattr(memory, "available_bytes", lambda: free)
    with pytest.raises(InputError, match=message):
        memory.check_processes(jobs, "jobs")
    memory.check_processes(min(cores, 2), "jobs")


def test_memory_is_of_the_case_and_not_of_the_past() -> None:
    """Oracle: 200 MB that were there and went; where the kernel can count anew, they are seen only before that."""
    if not memory.reset_peak():
        pytest.skip("/proc/self/clear_refs cannot be written here")
    before = memory.peak_mib(True)
    block = np.ones(25_000_000)
    with_block = memory.peak_mib(True)
    del block
    memory.reset_peak()
    after = memory.peak_mib(True)
    assert before and with_block and after
    assert with_block > before + 180 and after < with_block - 150
