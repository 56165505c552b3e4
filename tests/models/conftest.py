"""Fixtures of the model tests: a web server of one's own, and a cache directory that is empty."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from toy_server import Server


@pytest.fixture
def server() -> Iterator[Server]:
    """A server of this test alone."""
    made = Server()
    yield made
    made.httpd.shutdown()
    made.httpd.server_close()


@pytest.fixture(autouse=True)
def cache_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache directory that does not exist yet."""
    monkeypatch.setenv("DLAMA_MODELS", str(tmp_path / "cache"))
    return tmp_path / "cache"
