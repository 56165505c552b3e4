"""Which parameters of a test run always, and which with the slow tests alone."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def first_quick(values: Iterable[Any], quick: int = 1) -> list[Any]:
    """Values of a parameter: the first always; the others, which hold the same oracle to further data, are marked slow."""
    every = list(values)
    rest = (one if isinstance(one, tuple) else (one,) for one in every[quick:])
    return [*every[:quick], *(pytest.param(*one, marks=pytest.mark.slow) for one in rest)]
