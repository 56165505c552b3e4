"""Fixtures of the command line's tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tyro._parsers import ParserSpecification

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


@pytest.fixture(scope="session", autouse=True)
def one_parser_a_verb() -> Iterator[None]:
    """What tyro reads out of a verb's signature is read once: three quarters of the time of these tests otherwise."""
    read, known = ParserSpecification.from_callable_or_type, dict[Any, ParserSpecification]()

    def read_once(verb: Any, parent_classes: set[Any], description: Any, **more: Any) -> ParserSpecification:
        key = verb, description
        if parent_classes or key not in known:  # parts of a verb have parents, and other defaults each time
            found = read(verb, parent_classes=parent_classes, description=description, **more)
            return found if parent_classes else known.setdefault(key, found)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ParserSpecification, "from_callable_or_type", staticmethod(read_once))
        yield
