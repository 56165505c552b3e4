"""`dlama` run in this process on files of a folder; what it wrote or refused."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from box_frame import pixels
from dlama.apps.cli import main

__all__ = ["FAST", "pixels", "refused", "run"]
FAST = ["--filler", "telea"]


def run(folder: Path, *words: object) -> Path:
    """`dlama WORDS -o folder/out` with files named relative to the folder; returns the output directory."""
    known = [str(folder / str(word)) if (folder / str(word)).is_file() else str(word) for word in words]
    main([*known, "-o", str(folder / "out")])
    return folder / "out"


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *words: object) -> str:
    """The one line that the command prints on bad input; it exits with 2 and leaves nothing behind."""
    before = sorted(folder.rglob("*"))
    with pytest.raises(SystemExit) as stop:
        run(folder, *words)
    captured = capsys.readouterr()
    assert stop.value.code == 2
    assert captured.out == ""
    assert re.fullmatch(r"error: [^\n]+\n", captured.err), captured.err
    assert sorted(folder.rglob("*")) == before
    return captured.err
