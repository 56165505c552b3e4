"""Errors as they are shown (oracle: the text that was given)."""

from __future__ import annotations

from dlama.errors import LONGEST, FileError, OutputError


def test_a_message_with_a_very_long_value_is_shortened() -> None:
    """Its beginning (file and field) and its end (what is wanted) stay; a usual one stays whole."""
    for kind in (FileError, OutputError):
        assert str(kind("a.json: fx is 7; more is wanted")) == "a.json: fx is 7; more is wanted"
        shown = str(kind(f"a.json: fx is {'9' * 5000}; more is wanted"))
        assert shown.startswith("a.json: fx is 999") and shown.endswith("999; more is wanted") and len(shown) <= LONGEST
