"""What a verb reads and where it writes in; OutputError before any work is done, where the one would replace the other, out."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dlama.errors import OutputError, system_reason
from dlama.writing.atomic_write import check_folder_name, check_name

Inputs = Mapping[str, Path | str | None]
"""What a file or folder is to the verb (image, depth, data set) -> its path; None: not given."""


def given_files(inputs: Inputs) -> dict[str, Any]:
    """Those that are given."""
    return {role: path for role, path in inputs.items() if path is not None}


def check_folder_apart(output: Path, inputs: Inputs) -> None:
    """Raise OutputError where the directory `output` is the folder of an input, is itself the input, is a file, or named as one.

    Results have names like image.png and depth.png, and are placed as one folder.
    """
    check_place(check_folder_name(output))
    for role, given in given_files(inputs).items():
        path = Path(given)
        if _same(output, path) and path.is_dir():
            raise OutputError(f"`output` is {output}, an input of this run ({role}); give another directory")
        if path.is_file() and any(_same(output, one.parent) for one in (path, path.resolve())):
            raise OutputError(f"`output` is {output}, the folder of the {role} {path.name}; give another directory")


def check_file_apart(output: Path, inputs: Inputs, *, makes_folder: bool = False) -> None:
    """Raise OutputError where the file `output` is an input, by any path or link, or the folder of one, or cannot be written.

    makes_folder: the file's folder is made where it is not there.
    """
    for role, given in given_files(inputs).items():
        path = Path(given)
        if _same(output, path):
            raise OutputError(f"`output` is {output}, an input of this run ({role}); give another name")
    check_place(output.parent)
    there = makes_folder or output.parent.is_dir()
    wrong = "it is a directory" if output.is_dir() else "" if there else "its folder is not there"
    if wrong:
        raise OutputError(f"{output}: cannot be written: {wrong}")


def check_place(output: Path) -> None:
    """Raise OutputError where no directory `output` can be made or written to, as far as that can be known beforehand."""
    wrong, output = "", check_name(output)
    try:
        place = Path(os.path.realpath(output))
        while not os.path.lexists(place) and place != place.parent:
            place = place.parent
        if place.is_symlink():
            wrong = os.strerror(errno.ELOOP).lower()
        elif not place.is_dir():
            wrong = f"{'it' if place.name == output.name else place} is a file, a directory is expected"
        elif not os.access(place, os.W_OK | os.X_OK):
            wrong = f"{place} is not writable"
    except OSError as error:
        wrong = system_reason(error)
    if wrong:
        raise OutputError(f"{output}: cannot be written: {wrong}")


def _same(one: Path, other: Path) -> bool:
    """Whether both are there and are the same; what cannot be looked at is reported when it is read or written."""
    try:
        return one.samefile(other)
    except (OSError, ValueError):
        return False
