"""Fixtures of the page's tests: a small frame, and visits with it, without a server and with one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from servers import answering

from box_frame import small_frame
from dlama.web.answers import Limits
from dlama.web.server import Server
from dlama.web.visits import Visit, Visits, open_visits


@pytest.fixture
def frame(tmp_path: Path) -> Path:
    """A folder with image.png, depth.png (mm), mask.png (the box) of a box before a wall."""
    folder = tmp_path / "frame"
    folder.mkdir()
    return small_frame(folder)


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The system's folder for temporary files, of this test alone."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


@pytest.fixture
def visits(temporary: Path) -> Iterator[Visits]:
    """Visits without a server."""
    with open_visits(3) as opened:
        yield opened


@pytest.fixture
def visit(visits: Visits) -> Visit:
    """One of them."""
    return visits.begin()


@pytest.fixture
def server(temporary: Path) -> Iterator[Server]:
    """A server on a free port, answering."""
    with answering(Limits(1, 1.0, 3)) as opened:
        yield opened
