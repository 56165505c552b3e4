"""A path in; a place to write to out, which becomes that path only when all went well.

A run that is interrupted, fails or runs out of disk leaves nothing behind: no half file, no half directory, no mixture of two
runs. A killed run leaves a hidden draft, which the next run that writes there removes (`drafts`). What has been placed is
on the disk: a power cut does not empty it.

How a directory is replaced: the new one is written next to it, the old one renamed aside (`.dlama-old-...`), the new one renamed
to its place, then what else the old one held (other people's files) is moved back, and the old one is removed. A run that is
killed on the way is finished by the next one that writes there: the old directory returns to an empty place, else what is left
of other people's files is moved. A directory that cannot be renamed (a mount point, a parent closed to us, the folder somebody
works in) keeps its identity: files are moved into it one by one, and the next run completes that where one was killed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dlama.errors import OutputError, system_reason
from dlama.writing.drafts import (
    DRAFT,
    OLD,
    PLACING,
    find_abandoned,
    hold,
    in_a_draft,
    name_of,
    remove,
    remove_abandoned,
)

PathLike = str | os.PathLike[str]
"""A file's path."""
FILE_ENDINGS = (
    ".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".exr", ".gif", ".mp4",
    ".html", ".glb", ".ply", ".usdz", ".spz", ".npz", ".json",
)  # fmt: skip
"""A new name that ends so is meant as one file, and would be that of a directory."""


@contextmanager
def writing(place: PathLike, draft: PathLike | None = None) -> Iterator[None]:
    """Context: an error of the system becomes an OutputError: `place` cannot be written, and why; a `draft` is called `place`."""
    try:
        yield
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        reason = system_reason(error) if error.errno else str(error)
        raise OutputError(f"{place}: cannot be written: {reason.replace(str(draft), str(place))}") from error


@contextmanager
def new_file(path: PathLike) -> Iterator[Path]:
    """A temporary path next to `path` (same suffix) to write to; renamed to `path` on success, removed on failure.

    Folders on the way are not made. Raises OutputError when the place cannot be written.
    """
    target = check_name(path)
    draft = target.with_name(name_of(DRAFT, target.name))
    nested = in_a_draft(target.absolute())
    try:
        with writing(target, draft):
            if target.is_dir():
                raise IsADirectoryError(f"{target} is a directory")
            if not nested:
                remove_abandoned(target.absolute().parent)
            draft.touch(exist_ok=False)
            with hold(draft):
                yield draft
                if not nested:
                    _flush(draft)
                draft.replace(target)
    finally:
        with contextlib.suppress(OSError):
            draft.unlink(missing_ok=True)


def write_file(path: PathLike, content: str | bytes) -> None:
    """Write bytes, or text in UTF-8 (signs that it lacks, escaped), whole or not at all. Raises OutputError."""
    with new_file(path) as draft:
        draft.write_bytes(content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content)


@contextmanager
def new_directory(path: PathLike) -> Iterator[Path]:
    """A temporary directory to write results to; on success it becomes the directory `path`, or is merged into it, as a whole.

    Files of the same names are replaced, all others stay. On failure everything goes, also folders that were made on the way.
    Raises OutputError when the place cannot be written or is named as a file, or a file and a folder have the same name.
    """
    target, draft = check_folder_name(path), None
    made: list[Path] = []
    try:
        with writing(target):
            place = Path(os.path.realpath(target))  # a link keeps pointing to its directory
            draft = _draft_directory(place, made)
        with hold(draft):
            yield draft
            with writing(target):
                _place(draft, place)
    except BaseException as error:
        if draft is not None:
            shutil.rmtree(draft, ignore_errors=True)
        for folder in reversed(made):
            with contextlib.suppress(OSError):  # somebody else's file may lie in it by now
                folder.rmdir()
        if isinstance(error, OutputError):  # of a file in it: that is known by where it was to lie
            error.args = tuple(str(one).replace(str(draft), str(target)) for one in error.args)
        full = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))
        if isinstance(error, OSError) and error.errno in full and error.filename is None:  # of nothing by name
            with writing(target):
                raise
        raise


def check_name(path: PathLike) -> Path:
    """The path, if a file can be called so; else OutputError."""
    if "\0" in str(path):
        raise OutputError(f"{printable_name(path)}: cannot be written: no name holds NUL")
    if begins_at_home(path):  # a directory called ~ would be made, and who removes it removes the home directory
        raise OutputError(f"{path}: cannot be written: {NO_HOME}")
    return Path(path)


def check_folder_name(path: PathLike) -> Path:
    """The path, if a folder is there, or one can be called so and is not named as a file is; else OutputError."""
    folder = check_name(path)
    if folder.suffix.lower() in FILE_ENDINGS and not folder.is_dir():
        raise OutputError(f"{folder}: is the name of a file; a folder is expected, files in it get names of their own")
    return folder


NO_HOME = "~ is the home directory only where a shell replaces it, at the beginning of a word; give the whole path"


def printable_name(path: PathLike) -> str:
    """A path for a message, what cannot be printed escaped."""
    text = str(path)
    return text if text.isprintable() else text.encode("unicode_escape").decode("ascii")


def begins_at_home(path: PathLike) -> bool:
    """Whether a path begins with a ~ that nothing has replaced."""
    return Path(path).parts[:1] == ("~",)


def _draft_directory(target: Path, made: list[Path]) -> Path:
    """An empty directory on the same disk as `target`; folders made on the way are added to `made`, outermost first."""
    _finish_interrupted(target)
    if target.is_symlink():  # what is left of a name when its links are followed
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    if target.exists() and not target.is_dir():
        raise NotADirectoryError("it is a file, a directory is expected")
    for folder in [*reversed(target.parent.parents), target.parent]:
        if not folder.exists():
            folder.mkdir()
            made.append(folder)
    sibling = not target.exists() or _can_be_renamed(target)
    draft = (target.parent if sibling else target) / name_of(DRAFT, target.name)
    draft.mkdir()  # not tempfile: the result gets the rights any new directory gets
    return draft


def _can_be_renamed(target: Path) -> bool:
    """Whether another directory may take its place: not a mount point, not the folder we are in, its parent open to us."""
    with contextlib.suppress(OSError):
        here = Path.cwd()
        if here == target or target in here.parents:
            return False
    is_open = all(os.access(folder, os.W_OK | os.X_OK) for folder in (target.parent, target))
    return is_open and not target.is_mount()


def _place(draft: Path, target: Path) -> None:
    """The draft becomes `target`, with what `target` held besides. OSError; then `target` is as it was."""
    for path in draft.rglob("*"):
        if path.is_file():
            _flush(path)
    if not target.exists():
        draft.replace(target)
        return
    _refuse_conflicts(draft, target)
    if draft.parent == target.parent and _is_movable(draft, target):
        with contextlib.suppress(OSError):  # as file systems in layers refuse to rename folders
            _swap(draft, target)
            return
    _place_inside(draft, target)


def _swap(draft: Path, target: Path) -> None:
    """Rename the old directory aside and the new one to its place, and move what the old one held besides."""
    _copy_rights(target, draft)
    old = target.with_name(name_of(OLD, target.name))
    with hold(target):
        target.rename(old)
        try:
            draft.rename(target)
        except OSError:
            old.rename(target)
            raise
        _move_into(old, target, replace=False)


def _place_inside(draft: Path, target: Path) -> None:
    """Move all of the draft into `target`, one by one. A run that is killed meanwhile is finished by `_finish_interrupted`."""
    whole = target / name_of(PLACING, target.name)
    draft.rename(whole)
    with hold(whole):
        try:
            _move_into(whole, target, replace=True)
        except OSError:
            remove(whole)
            raise


def _finish_interrupted(target: Path) -> None:
    """What runs that were killed while they placed a directory left undone, and their drafts."""
    for old in find_abandoned(target.parent, OLD, target.name):
        if target.exists():
            _move_into(old, target, replace=False)
        else:
            old.rename(target)
    for whole in find_abandoned(target, PLACING):
        _move_into(whole, target, replace=True)
    remove_abandoned(target.parent)
    remove_abandoned(target)


def _move_into(source: Path, target: Path, replace: bool) -> None:
    """Move all of `source` into `target` by renames, merging folders; what is there stays unless `replace`. Then it is gone."""
    for entry in sorted(source.iterdir()):
        place = target / entry.name
        if _is_folder(entry) and place.is_dir():
            _move_into(entry, place, replace)
        elif replace or not os.path.lexists(place):
            entry.replace(place)
    shutil.rmtree(source, ignore_errors=True)


def _refuse_conflicts(draft: Path, target: Path) -> None:
    """OSError where a file would have to take the place of a folder, or a folder that of a file: nothing is placed then."""
    for entry in draft.iterdir():
        place = target / entry.name
        if entry.is_dir() and place.exists() and not place.is_dir():
            raise NotADirectoryError(f"{place.name} in it is a file, a directory is expected")
        if entry.is_dir() and place.is_dir():
            _refuse_conflicts(entry, place)
        elif not entry.is_dir() and _is_folder(place):
            raise IsADirectoryError(f"{place.name} in it is a directory, a file is expected")


def _is_movable(draft: Path, target: Path) -> bool:
    """Whether everything in `target` can be moved out of it: folders must be open to us, and no mount points."""
    for entry in target.iterdir():
        if _is_folder(entry) and (entry.is_mount() or not os.access(entry, os.W_OK | os.X_OK)):
            return False
        if _is_folder(entry) and (draft / entry.name).is_dir() and not _is_movable(draft / entry.name, entry):
            return False
    return True


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _copy_rights(old: Path, new: Path) -> None:
    """Rights and owner of the old folder for the new one, as far as that is allowed."""
    with contextlib.suppress(OSError):
        shutil.copymode(old, new)
        found = old.stat()
        if hasattr(os, "chown") and (found.st_uid, found.st_gid) != (new.stat().st_uid, new.stat().st_gid):
            os.chown(new, found.st_uid, found.st_gid)


def _flush(path: Path) -> None:
    """What was written is on the disk afterwards. OSError: the disk is full, or failed."""
    handle = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:  # file systems that cannot flush are no reason to fail
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.EROFS, errno.EACCES, errno.EPERM):
            raise
    finally:
        os.close(handle)
