"""A function of a noun in; the same function, computed once for each noun, out."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TypeVar
from weakref import WeakKeyDictionary

Noun = TypeVar("Noun")
Found = TypeVar("Found")


def once(function: Callable[[Noun], Found]) -> Callable[[Noun], Found]:
    """Decorator: what the function gave for a view or a scene is kept as long as that is alive."""
    kept: WeakKeyDictionary[Noun, Found] = WeakKeyDictionary()

    @functools.wraps(function)
    def of(noun: Noun) -> Found:
        if noun not in kept:
            kept[noun] = function(noun)
        return kept[noun]

    return of
