"""Examples in docstrings run as they stand (oracle: what stands below each of their lines)."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

import dlama

MODULES = ("completion.verbs", "geometry.camera", "geometry.projection", "geometry.motion.trajectories")
"""Modules of public functions that have examples."""


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name: str) -> None:
    found = doctest.testmod(importlib.import_module(f"dlama.{name}"))
    assert found.attempted > 2 and found.failed == 0


def test_every_module_with_examples_is_listed() -> None:
    """Of those that public names come from."""
    with_examples = {place for place in dlama.MODULES.values() if ">>> " in _text(place)}
    assert with_examples == set(MODULES)


def _text(place: str) -> str:
    path = importlib.import_module(f"dlama.{place}").__file__
    assert path is not None
    return Path(path).read_text("utf-8")
