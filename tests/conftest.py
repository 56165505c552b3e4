"""Fixtures of all tests; this folder is on the import path, so `worlds` and `reference.*` import from any test."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real data, from DLAMA_DATA; a test skips where that is unset, and fails where it is wrong."""
    told = os.environ.get("DLAMA_DATA")
    if not told:
        pytest.skip("DLAMA_DATA is not set; it names the folder that holds data/ and street/")
    folder = Path(told)
    assert folder.is_dir(), f"DLAMA_DATA is {told}, which is no folder"
    return folder
