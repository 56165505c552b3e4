"""A noun and a function of it in; what the function found, once for as long as the noun is alive, out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

Noun = TypeVar("Noun", bound="Kept")
Found = TypeVar("Found")

_found: WeakKeyDictionary[Kept, dict[Callable[..., Any], Any]] = WeakKeyDictionary()
"""Noun -> function -> what it found; not fields of the nouns, which are sent to other processes."""


class Kept:
    """A noun for which what was found is kept."""

    def find_once(self: Noun, find: Callable[[Noun], Found]) -> Found:
        """What `find` gives for it, found at the first call."""
        known = _found.setdefault(self, {})
        if find not in known:
            known[find] = find(self)
        found: Found = known[find]
        return found
