"""A pattern of pictures, and how their depths and masks are called, in; rows of a job list out."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dlama.errors import InputError


@dataclass(frozen=True)
class Pictures:
    """The pictures of a pattern; iterated over, a row for each, sorted."""

    images: str
    """`rgb/*.png`; ** goes through folders."""
    depths: str | None = None
    """Where a picture's depth lies: `depth/{stem}.png`; {stem} is its name, {name} that with suffix, {folder} its folder."""
    masks: str | None = None
    """The same of its mask."""
    output: str | None = None
    """Where results go, which are no pictures to begin with, where it lies below the pattern's folder."""

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """A row's id is the picture's path below the fixed folders of the pattern, without suffix. InputError: no picture."""
        root, empty = _fixed_folders(self.images), True
        pattern = glob.escape(root) + self.images[len(root) :]
        results, above = self.output and Path(self.output).resolve(), Path(root).resolve()
        results = None if results in (above, *above.parents) else results
        found = glob.glob(pattern, recursive=True)  # noqa: PTH207  (keeps the pattern's own form of paths)
        for path in [self.images] if Path(self.images).is_file() else sorted(found):
            if Path(path).is_dir() or results in Path(path).resolve().parents:
                continue
            empty = False
            row = {"id": Path(os.path.relpath(path, root or ".")).with_suffix("").as_posix(), "image": path}
            patterns = {"depth": self.depths, "mask": self.masks}
            yield row | {role: fill_pattern(pattern, path, role) for role, pattern in patterns.items() if pattern}
        if empty:
            folder = f", it is a folder; {self.images}/*.jpg takes what is in it" if Path(self.images).is_dir() else ""
            raise InputError(f"`images` is {self.images!r}; no picture is called so{folder}")


def fill_pattern(pattern: str, image: str, role: str) -> str:
    """The pattern with what it says of a picture; raises InputError."""
    path = Path(image)
    try:
        return pattern.format(stem=path.stem, name=path.name, folder=str(path.parent))
    except (KeyError, IndexError, ValueError) as error:
        raise InputError(f"`{role}s` is {pattern!r}; {{stem}}, {{name}} and {{folder}} are what it may hold") from error


def _fixed_folders(pattern: str) -> str:
    """The longest beginning of a pattern, up to a slash, that is a folder as it stands: `shot [A]/` is no class of letters."""
    ends = [slash.end() for slash in re.finditer(r"[/\\]" if os.name == "nt" else "/", pattern)]
    return next((pattern[:end] for end in reversed(ends) if Path(pattern[:end]).is_dir()), "")
