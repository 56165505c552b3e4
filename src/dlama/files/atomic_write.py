"""A path in; a place to write to out, which becomes that path only when all went well.

Whoever is interrupted, fails or runs out of disk leaves nothing behind: no half file, no half directory.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dlama.errors import OutputError

PathLike = str | os.PathLike[str]
"""Whatever names a file."""


@contextmanager
def new_file(path: PathLike) -> Iterator[Path]:
    """A temporary path beside `path` (same suffix) to write to; renamed to `path` on success, removed on failure.

    Folders on the way are not made. Raises OutputError when the place cannot be written.
    """
    target = Path(path)
    draft = target.with_name(f".{target.stem[:80]}-{os.urandom(4).hex()}{target.suffix}")
    try:
        if target.is_dir():
            raise IsADirectoryError(f"{target} is a directory")
        draft.touch(exist_ok=False)
        yield draft
        draft.replace(target)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"{target}: cannot be written: {_reason(error)}") from error
    finally:
        with contextlib.suppress(OSError):
            draft.unlink(missing_ok=True)


@contextmanager
def new_directory(path: PathLike) -> Iterator[Path]:
    """A temporary directory to write results to; its files are moved to the directory `path` on success.

    An existing directory is reused: files of the same names are replaced, all others stay. On failure everything goes,
    also folders that were made on the way. Raises OutputError when the place cannot be written.
    """
    target = Path(path)
    made: list[Path] = []
    try:
        draft = _draft_directory(target, made)
    except OSError as error:
        _remove(made)
        raise OutputError(f"{target}: cannot be written: {_reason(error)}") from error
    try:
        yield draft
        try:
            _move_into(draft, target)
        except OSError as error:
            raise OutputError(f"{target}: cannot be written: {_reason(error)}") from error
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        _remove(made)
        raise


def _draft_directory(target: Path, made: list[Path]) -> Path:
    """An empty directory on the same disk as `target`; folders made on the way are added to `made`, outermost first."""
    if target.exists() and not target.is_dir():
        raise NotADirectoryError("it is a file, a directory is wanted")
    if target.is_dir():  # inside, not beside: it may be a mount point, or its parent may be closed to us
        draft = target / f".unfinished-{os.urandom(4).hex()}"
    else:
        for folder in [*reversed(target.parent.parents), target.parent]:
            if not folder.exists():
                folder.mkdir()
                made.append(folder)
        draft = target.parent / f".{target.name}-{os.urandom(4).hex()}"
    draft.mkdir()  # not tempfile: the result gets the rights any new directory gets
    return draft


def _move_into(draft: Path, target: Path) -> None:
    """Everything of `draft` to `target`, by renames only; folders that exist on both sides are merged."""
    if not target.exists():
        draft.replace(target)
        return
    for entry in sorted(draft.iterdir()):
        if entry.is_dir():
            _move_into(entry, target / entry.name)
        else:
            entry.replace(target / entry.name)
    shutil.rmtree(draft, ignore_errors=True)


def _remove(made: list[Path]) -> None:
    for folder in reversed(made):
        with contextlib.suppress(OSError):  # somebody else's file may lie in it by now
            folder.rmdir()


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower() if error.errno else str(error)
