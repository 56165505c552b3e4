"""A path, or an address such as s3://bucket/key, in; a stream to read, a local copy, a place for results, out.

Local paths need nothing; addresses go through fsspec, which knows S3, Google Cloud Storage, HTTP, memory:// and more.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, Any

from dlama.errors import FileError, MissingExtraError, OutputError, first_line, import_extra
from dlama.writing.atomic_write import new_file, writing
from dlama.writing.drafts import DRAFT, hold, name_of, remove
from dlama.writing.unchanged import stamp_of

MARKER = "meta.json"
"""The file of a result that is written last where a folder cannot be placed as a whole: with it the result is there."""


def is_address(path: str) -> bool:
    """Whether a path names something that is not a file of this computer's own file systems."""
    return "://" in path and not path.startswith("file://")


def local_path(path: str) -> str:
    """A path without file://."""
    return path.removeprefix("file://")


def folder_of(path: str) -> str:
    """What relative paths of a list start from."""
    return path.rpartition("/")[0] if is_address(path) else str(Path(local_path(path)).absolute().parent)


@contextmanager
def open_to_read(path: str, mode: str = "r") -> Iterator[IO[Any]]:
    """A file to read; text is UTF-8, with or without a byte order mark. FileError where there is none."""
    text: dict[str, Any] = {} if "b" in mode else {"encoding": "utf-8-sig", "newline": ""}
    try:
        if not is_address(path):
            with Path(local_path(path)).open(mode, **text) as stream:
                yield stream
            return
        system, inside = file_system(path)
        with system.open(inside, mode, **text) as stream:
            yield stream
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: is no text in UTF-8 ({first_line(error)})") from error
    except OSError as error:
        if isinstance(error, (FileError, OutputError)):
            raise
        raise FileError(f"{path}: cannot be read: {_why_unread(error)}") from error


def file_stamp(path: str) -> str:
    """By what an unchanged file is known without reading it: size and time of change; empty: there is none."""
    try:
        if not is_address(path):
            return "{}-{}".format(*stamp_of(Path(local_path(path))))
        system, inside = file_system(path)
        return str(system.ukey(inside))
    except (OSError, ValueError):
        return ""


@contextmanager
def fetch(files: Mapping[str, str]) -> Iterator[dict[str, Path]]:
    """Role -> a local file of each; addresses are copied to a folder that is removed at the end. FileError."""
    with contextlib.ExitStack() as stack:
        places: dict[str, Path] = {}
        for role, path in files.items():
            if not is_address(path):
                places[role] = Path(local_path(path))
                continue
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="dlama-")))
            places[role] = folder / PurePosixPath(path).name
            try:
                system, inside = file_system(path)
                system.get_file(inside, str(places[role]))
            except (OSError, ValueError) as error:
                raise FileError(f"{path}: cannot be read: {_why_unread(error)}") from error
        yield places


def _why_unread(error: OSError | ValueError) -> str:
    """In words; of a file that is not there fsspec gives the name alone."""
    if isinstance(error, FileNotFoundError):
        return os.strerror(errno.ENOENT).lower()
    return first_line(error) if isinstance(error, ValueError) else (error.strerror or first_line(error)).lower()


@dataclass(frozen=True)
class Output:
    """Where results go: a folder of this computer, or an address."""

    place: str

    @property
    def is_remote(self) -> bool:
        """Whether it is an address."""
        return is_address(self.place)

    def of(self, name: str) -> str:
        """The path or address of what lies under a name there."""
        return f"{self.place.rstrip('/')}/{name}" if self.is_remote else str(Path(local_path(self.place), name))

    def has(self, name: str) -> bool:
        """Whether a whole result lies there, or the tar shard of that name."""
        return self.exists(name if name.endswith(".tar") else f"{name}/{MARKER}")

    def exists(self, name: str) -> bool:
        """Whether a file lies there."""
        if not self.is_remote:
            return Path(self.of(name)).is_file()
        system, inside = file_system(self.of(name))
        return bool(system.exists(inside))

    @contextmanager
    def open(self, name: str, mode: str = "w") -> Iterator[IO[Any]]:
        """What lies under a name there, to write; it appears as a whole when it is closed. OutputError."""
        text: dict[str, Any] = {} if "b" in mode else {"encoding": "utf-8", "newline": "", "errors": "backslashreplace"}
        if self.is_remote:
            system, inside = file_system(self.of(name))
            system.makedirs(inside.rpartition("/")[0], exist_ok=True)
            with system.open(inside, mode, **text) as stream:
                yield stream
            return
        target = Path(self.of(name))
        target.parent.mkdir(exist_ok=True)
        with new_file(target) as draft, draft.open(mode, **text) as stream:
            yield stream

    def remove(self, name: str) -> None:
        """A file or folder there goes."""
        if self.is_remote:
            system, inside = file_system(self.of(name))
            system.rm(inside, recursive=True)
        else:
            remove(Path(self.of(name)))

    def names(self, folder: str) -> list[str]:
        """The files below a folder there, relative to it, sorted; none where there is no such folder."""
        if not self.is_remote:
            return _files_below(Path(self.of(folder)))
        system, inside = file_system(self.of(folder))
        return sorted(one[len(inside) :].strip("/") for one in system.find(inside)) if system.exists(inside) else []

    @contextmanager
    def staging(self) -> Iterator[Path]:
        """An empty local folder for a result that is being made; of results on this computer on the same disk."""
        if self.is_remote:
            with tempfile.TemporaryDirectory(prefix="dlama-") as folder:
                yield Path(folder)
            return
        root = Path(local_path(self.place)).absolute()
        draft = root / name_of(DRAFT, "job")
        with writing(root):
            root.mkdir(parents=True, exist_ok=True)
            draft.mkdir()
        try:
            with hold(draft):
                yield draft
        finally:
            remove(draft)

    def put(self, folder: Path, name: str) -> None:
        """A whole result, made in `staging`, becomes what lies under a name; an earlier one goes. OutputError."""
        target = self.of(name)
        with writing(target):
            if self.is_remote:
                self._upload(folder, name)
            else:
                _swap(folder, Path(target))

    def _upload(self, folder: Path, name: str) -> None:
        """An earlier result goes, its marker first; the marker of the new one comes last."""
        system, inside = file_system(self.of(name))
        for file in sorted(self.names(name), key=lambda file: file != MARKER):
            self.remove(f"{name}/{file}")
        for file in sorted(_files_below(folder), key=lambda file: file == MARKER):
            place = f"{inside}/{file}"
            system.makedirs(place.rpartition("/")[0], exist_ok=True)
            system.put_file(str(folder / file), place)


def _files_below(folder: Path) -> list[str]:
    """The files below a folder of this computer, relative to it, sorted; none where there is no such folder."""
    return sorted(one.relative_to(folder).as_posix() for one in folder.rglob("*") if one.is_file())


def _swap(folder: Path, target: Path) -> None:
    """Two renames on one disk: an earlier result goes aside, the new one comes to its place."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if os.path.lexists(target):
        if not (target / MARKER).is_file():
            raise OutputError(
                f"{target}: is there already and is no result of dlama; remove it, or give another directory"
            )
        target.rename(folder.with_name(f"{folder.name}-old"))
    folder.rename(target)
    shutil.rmtree(folder.with_name(f"{folder.name}-old"), ignore_errors=True)


def file_system(path: str) -> tuple[Any, str]:
    """The fsspec file system of an address, and the path inside it. FileError where nothing knows its protocol."""
    try:
        return import_extra("fsspec", path, "fsspec", "batch").core.url_to_fs(path)
    except (ValueError, ImportError) as error:
        if isinstance(error, MissingExtraError):
            raise
        raise FileError(f"{path}: {first_line(error)}") from error
