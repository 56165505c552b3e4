"""`worlds`, `worlds:COUNT` or `worlds:COUNT:SEED`, or a folder, in; the Dataset that is generated or lies there out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dlama.datasets.frames import Dataset
from dlama.datasets.layouts import narrowed, open_dataset, refuse
from dlama.errors import InputError
from dlama.worlds.dataset import LAYOUT, worlds

DEFAULT_COUNT = 4
"""How many worlds the bare name generates."""


def open_dataset_or_worlds(
    path: Path | str,
    layout: str | None = None,
    *,
    scenes: Sequence[str] | None = None,
    limit: int | None = None,
    **options: Any,
) -> Dataset:
    """The data set in a folder, or a generated one where no folder has that name.

    `scenes`, `limit` and `options` are those of `open_dataset`; generated worlds take the first two alone. Raises InputError (a
    malformed name, an option that worlds do not take) and what `open_dataset` raises.
    """
    if Path(path).is_dir() or not (str(path) == LAYOUT or str(path).startswith(f"{LAYOUT}:")):
        return open_dataset(path, layout, scenes=scenes, limit=limit, **options)
    if limit is not None and limit < 1:
        raise InputError(f"limit is {limit}; a whole number >= 1 is wanted")
    refuse(LAYOUT, frozenset(), **options)
    if layout is not None:
        raise InputError(f"'{path}' is generated and has no layout; layout {layout} is for folders")
    return narrowed(generated(str(path)), scenes, limit)


def generated(name: str) -> Dataset:
    """The worlds of a name: `worlds`, with a count and a seed behind colons. InputError where it is malformed."""
    _, *numbers = name.split(":")
    if len(numbers) > 2 or not all(number.isdecimal() for number in numbers) or numbers[:1] == ["0"]:
        raise InputError(
            f"'{name}' is no name of generated worlds; worlds, worlds:COUNT or worlds:COUNT:SEED is wanted"
        )
    count = int(numbers[0]) if numbers else DEFAULT_COUNT
    return worlds(count, seed=int(numbers[1]) if len(numbers) > 1 else 0)
