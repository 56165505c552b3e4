"""Fixtures of the command line's tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from box_frame import small_frame
from dlama.geometry.kernels import jit


@pytest.fixture
def frame(tmp_path: Path) -> Path:
    """A folder with image.png, depth.png (mm), mask.png (the box) of a box before a wall."""
    return small_frame(tmp_path)


@pytest.fixture(autouse=True)
def kernels_are_no_news(monkeypatch: pytest.MonkeyPatch) -> None:
    """The note about the first run is test_terminal's; elsewhere what is printed is the same with and without it."""
    monkeypatch.setattr(jit._LISTENER, "announced", True)
