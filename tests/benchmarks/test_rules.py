"""The switches of rules (oracles: the package itself, in which what a switch replaces must be; its values before and after)."""

from __future__ import annotations

import pytest

import rules
from dlama.inpainters.layered import filler

ALL = rules.RULES | rules.SHADOW_RULES | rules.MASK_RULES


@pytest.mark.parametrize("rule", ALL)
def test_every_switch_finds_what_it_replaces(rule: str) -> None:
    """A rule that moved, or whose number has no name any more, cannot be switched off: that is an error, not a gain of 0."""
    with rules.without(rule):
        assert rules._REPLACED
    assert not rules._REPLACED


def test_what_was_switched_off_comes_back() -> None:
    """Law: after the block the number is as before."""
    before = filler.NEARER
    with rules.without("narrow-occluders"):
        assert float("inf") == filler.NEARER
    assert before == filler.NEARER
