"""Workers of batches that need no process of their own."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent))  # worker processes look for `small_jobs` where this process does
from small_jobs import InThisProcess

from dlama.jobs import batch


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Batches run their jobs here: starting processes takes most of the time of small ones (tests/workers has these)."""
    monkeypatch.setattr(batch, "worker_starter", lambda *_: lambda: InThisProcess(batch.work))
