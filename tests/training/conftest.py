"""Fixtures of the training's tests; this folder is on the import path, so `toy_runs` imports from any of them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from toy_runs import keep_worlds

from dlama.training.data.samples import world_views


@pytest.fixture(scope="session", autouse=True)
def worlds_are_kept() -> Iterator[None]:
    """Runs of a few steps take most of their time to build the worlds that the run before them had, too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(world_views, "_world_views", world_views._world_views)
        keep_worlds()
        yield
