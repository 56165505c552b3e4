"""Drafts of ended processes are abandoned, zombies among them (oracle: the process table)."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from dlama.writing.drafts import DRAFT, HOST, remove_abandoned


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system has no /proc")
def test_the_draft_of_a_zombie_is_removed_and_that_of_a_running_process_stays(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        draft = tmp_path / f"{DRAFT}{process.pid}@{HOST}-01234567-out"
        draft.mkdir()
        remove_abandoned(tmp_path, again=True)
        assert draft.exists()
        assert process.stdin is not None
        process.stdin.close()
        stat = Path(f"/proc/{process.pid}/stat")
        while stat.read_text("utf-8").rpartition(")")[2].split()[0] != "Z":  # nobody waits for it yet
            pass
        remove_abandoned(tmp_path, again=True)
        assert not draft.exists()
