"""`dlama` run in this process on files of a folder, or by a shell; what it wrote or refused."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from box_frame import pixels
from dlama.apps.cli import main

__all__ = ["FAST", "error_line", "pixels", "refused", "run", "shell"]
FAST = ["--filler", "telea"]


def words_in(folder: Path, *words: object) -> list[str]:
    """`WORDS -o folder/out` with files named relative to the folder."""
    known = [str(folder / str(word)) if (folder / str(word)).is_file() else str(word) for word in words]
    return [*known, "-o", str(folder / "out")]


def run(folder: Path, *words: object) -> Path:
    """`dlama WORDS -o folder/out` with files named relative to the folder; returns the output directory."""
    main(words_in(folder, *words))
    return folder / "out"


def error_line(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The one line that `dlama WORDS` prints on bad input; it prints nothing else and exits with 2."""
    with pytest.raises(SystemExit) as stop:
        main(list(words))
    captured = capsys.readouterr()
    assert stop.value.code == 2
    assert captured.out == ""
    assert re.fullmatch(r"error: [^\n]+\n", captured.err), captured.err
    return captured.err


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *words: object) -> str:
    """`error_line` of `dlama WORDS -o folder/out`, which leaves nothing behind."""
    before = sorted(folder.rglob("*"))
    line = error_line(capsys, *words_in(folder, *words))
    assert sorted(folder.rglob("*")) == before
    return line


def shell(words: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """`dlama WORDS`, redirections and all; its streams are no terminal."""
    line = f"{sys.executable} -m dlama {words}"
    return subprocess.run(
        ["sh", "-c", line], cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True, timeout=600
    )
