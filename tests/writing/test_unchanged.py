"""A file is read again only when it has changed (oracle: what was read, and how often)."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dlama.writing.unchanged import while_unchanged


def test_a_file_is_read_again_once_it_has_changed(tmp_path: Path) -> None:
    """Another content or another time is a change; other arguments are calls of their own, and the oldest is forgotten."""
    file, calls = tmp_path / "file", list[int]()

    @while_unchanged(keep=2)
    def read(path: Path, number: int) -> str:
        calls.append(number)
        return path.read_text()

    file.write_text("one")
    assert [read(file, number) for number in (1, 1, 2, 1)] == ["one"] * 4 and calls == [1, 2]
    file.write_text("three")
    assert read(file, 1) == "three"
    os.utime(file, ns=(0, 0))
    assert read(file, 1) == "three" and calls == [1, 2, 1, 1]
    file.unlink()
    with pytest.raises(OSError, match="file"):
        read(file, 1)
