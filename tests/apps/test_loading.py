"""Modules loaded without a search for garbage (oracle: the state of Python's own collector)."""

from __future__ import annotations

import gc

import pytest

from dlama.apps.loading import loading


@pytest.mark.parametrize("collecting", [True, False])
def test_the_collector_continues_as_before_and_skips_what_was_loaded(collecting: bool) -> None:
    """Law: it is off meanwhile, and then as it was, after errors too; what was made meanwhile is out of its sight."""
    before, frozen = gc.isenabled(), gc.get_freeze_count()
    try:
        (gc.enable if collecting else gc.disable)()
        with pytest.raises(ImportError), loading():
            assert not gc.isenabled()
            made: list[list[int]] = [[] for _ in range(1000)]
            raise ImportError
        assert gc.isenabled() == collecting
        assert gc.get_freeze_count() >= frozen + len(made)
    finally:
        gc.unfreeze()
        (gc.enable if before else gc.disable)()
