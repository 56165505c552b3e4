"""A folder in; hidden names for what is being written there, and the drafts that killed runs left there, out.

A name is `.dlama-draft-PID@HOST-RANDOM-NAME`. A process holds a lock on each of its drafts, which the system releases when the
process ends, however it ends. A draft is abandoned if nobody holds it and its process has ended, or is unknown for an hour.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import socket
import time
from collections.abc import Iterator
from pathlib import Path

from dlama.errors import OutputError

try:
    import fcntl
except ImportError:  # Windows: age alone decides
    fcntl = None  # type: ignore[assignment]

DRAFT, OLD, PLACING = ".dlama-draft-", ".dlama-old-", ".dlama-placing-"
"""Prefixes: being written; an earlier folder that a new one has just replaced; whole, and being moved to its place."""
HOST = re.sub(r"[^A-Za-z0-9.]", "", socket.gethostname())[:20] or "host"

_mine: set[str] = set()
"""Drafts of this process."""
_swept: set[str] = set()
"""Folders this process has looked through."""


def name_of(prefix: str, name: str) -> str:
    """A new hidden name for `name`, with its suffix."""
    return f"{prefix}{os.getpid()}@{HOST}-{os.urandom(4).hex()}-{_short_name(name)}"


def _short_name(name: str) -> str:
    if len(os.fsencode(name)) <= 120:  # file systems take 255
        return name
    suffix = Path(name).suffix
    return hashlib.sha256(os.fsencode(name)).hexdigest()[:16] + (suffix if len(os.fsencode(suffix)) <= 20 else "")


@contextlib.contextmanager
def hold(path: Path) -> Iterator[None]:
    """While this is open, `path` (a file or folder that is there, and may be renamed) belongs to this process."""
    key = str(path)
    _mine.add(key)
    try:
        with lock(path):
            yield
    finally:
        _mine.discard(key)


@contextlib.contextmanager
def lock(path: Path) -> Iterator[bool]:
    """While this is open, no other process can lock that file or folder. False: another one has; True, too, where the file
    system, or Windows, has no locks."""
    handle, free = None, True
    if fcntl is not None:
        with contextlib.suppress(OSError):
            writes = path.is_file() and os.access(path, os.W_OK)  # NFS locks no file that is open to be read
            handle = os.open(path, os.O_RDWR if writes else os.O_RDONLY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                free = False
    try:
        yield free
    finally:
        if handle is not None:
            os.close(handle)


@contextlib.contextmanager
def lock_output(path: Path, place: Path | str) -> Iterator[None]:
    """While this is open, `path` is locked, and no other run writes to `place`. OutputError: another one does."""
    with lock(path) as free:
        if not free:
            raise OutputError(f"{place}: another run is writing there; wait for it, or give another directory")
        yield


def in_a_draft(path: Path) -> bool:
    """Whether `path` lies in a folder that this process is writing, and that will be placed as a whole."""
    return any(str(parent) in _mine for parent in path.parents)


def remove_abandoned(folder: Path, *, again: bool = False) -> None:
    """Remove the drafts that killed runs left in `folder`; once a process for each folder, unless `again`. Raises nothing."""
    if str(folder) in _swept and not again:
        return
    _swept.add(str(folder))
    for path in find_abandoned(folder, DRAFT):
        remove(path)


def find_abandoned(folder: Path, prefix: str, name: str | None = None) -> list[Path]:
    """What ended processes left in `folder` under that prefix, sorted; `name`: only of that file or folder. Raises nothing."""
    try:
        with os.scandir(folder) as entries:
            names = sorted(entry.name for entry in entries if entry.name.startswith(prefix))
    except OSError:
        return []
    end = "" if name is None else f"-{_short_name(name)}"
    return [folder / each for each in names if each.endswith(end) and is_abandoned(folder / each, prefix)]


def is_abandoned(path: Path, prefix: str) -> bool:
    """Whether the process that made `path` has ended. False where that cannot be known."""
    match = re.match(r"(\d+)@([A-Za-z0-9.]*)-[0-9a-f]{8}-", path.name[len(prefix) :])
    if match is None or str(path) in _mine or _is_locked(path):
        return False
    pid, host = int(match[1]), match[2]
    if host == HOST and os.name == "posix" and (pid == os.getpid() or not _is_running(pid)):
        return True
    try:  # the process cannot be asked after (another computer's, Windows)
        return time.time() - path.stat().st_mtime > 3600
    except OSError:
        return False


def _is_locked(path: Path) -> bool:
    if not os.access(path, os.R_OK):
        return True  # not ours to remove
    with lock(path) as free:
        return not free


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return not _is_zombie(pid)


def _is_zombie(pid: int) -> bool:
    """Whether a process has ended and its parent has not asked for its exit code yet; False without /proc."""
    try:
        return Path(f"/proc/{pid}/stat").read_text("utf-8", "replace").rpartition(")")[2].split()[:1] == ["Z"]
    except OSError:
        return False


def remove(path: Path) -> None:
    """Remove a file or a folder with all in it, as far as that goes. Raises nothing."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink()
