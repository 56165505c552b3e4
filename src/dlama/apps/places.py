"""What a verb reads and where it writes in; OutputError before any work is done, where the one would replace the other, out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from dlama.errors import OutputError

Inputs = Mapping[str, Path | str | None]
"""What a file or folder is to the verb (image, depth, data set) -> its path; None: not given."""


def check_folder_apart(output: Path, inputs: Inputs, beside: Inputs | None = None) -> None:
    """Raise OutputError where the directory `output` is the folder of an input, is itself the input, or is a file.

    Results have names like image.png and depth.png, and are placed as one folder. beside: inputs that may lie in the output
    (a camera file, a network), where no result has their name (which is checked when results are written).
    """
    if _is_file(output):
        raise OutputError(f"{output}: cannot be written: it is a file, a directory is wanted")
    for role, path in _given(inputs):
        if _same(output, path) and path.is_dir():
            raise OutputError(f"output is {output}, an input of this run ({role}); give another directory")
        if path.is_file() and any(_same(output, one.parent) for one in (path, path.resolve())):
            raise OutputError(f"output is {output}, the folder of the {role} {path.name}; give another directory")
    for role, path in _given(beside or {}):
        if _same(output, path):
            raise OutputError(f"output is {output}, an input of this run ({role}); give another directory")


def check_file_apart(output: Path, inputs: Inputs) -> None:
    """Raise OutputError where the file `output` is an input, by any path or link, or the folder of one."""
    for role, path in _given(inputs):
        if _same(output, path):
            raise OutputError(f"output is {output}, an input of this run ({role}); give another name")


def _is_file(path: Path) -> bool:
    """Whether a file is there; what cannot be looked at is reported when it is written."""
    try:
        return path.is_file()
    except OSError:
        return False


def _given(inputs: Inputs) -> list[tuple[str, Path]]:
    return [(role, Path(path)) for role, path in inputs.items() if path is not None]


def _same(one: Path, other: Path) -> bool:
    """Whether both are there and are the same; what cannot be looked at is reported when it is read or written."""
    try:
        return one.samefile(other)
    except (OSError, ValueError):
        return False
