"""Fixtures of the command line's tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_frame import small_frame


@pytest.fixture
def frame(tmp_path: Path) -> Path:
    """A folder with image.png, depth.png (mm), mask.png (the box) of a box before a wall."""
    return small_frame(tmp_path)
