"""A function of a file in; one that reads the file again only when it has changed, out."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


def while_unchanged(keep: int) -> Callable[[F], F]:
    """Decorator: what a function of a file, and of further arguments, returned is returned again while the file's size and time
    of change stay; of so many calls. OSError where there is no file."""

    def decorate(read: F) -> F:
        @functools.lru_cache(maxsize=keep)
        def kept(path: Path, stamp: tuple[int, int], *more: Any) -> Any:
            return read(path, *more)

        @functools.wraps(read)
        def call(path: Path, *more: Any) -> Any:
            found = path.stat()
            return kept(path, (found.st_size, found.st_mtime_ns), *more)

        return cast(F, call)

    return decorate
