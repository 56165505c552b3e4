"""A file in; by what it is known while it does not change, and functions that read it again only when it has changed, out."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


def stamp_of(path: Path) -> tuple[int, int]:
    """Size and time of change of a file, by which one that was written again is known. OSError where there is none."""
    found = path.stat()
    return found.st_size, found.st_mtime_ns


def while_unchanged(keep: int) -> Callable[[F], F]:
    """Decorator: what a function of a file, and of further arguments, returned is returned again while the file's `stamp_of`
    stays; of so many calls. OSError where there is no file."""

    def decorate(read: F) -> F:
        @functools.lru_cache(maxsize=keep)
        def kept(path: Path, stamp: tuple[int, int], *more: Any) -> Any:
            return read(path, *more)

        @functools.wraps(read)
        def call(path: Path, *more: Any) -> Any:
            return kept(path, stamp_of(path), *more)

        return cast(F, call)

    return decorate
