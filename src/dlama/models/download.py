"""An address and a .part file in; the .part file, as long as the server announced, out. It resumes where it broke off.

What was continued is held against its hash by the caller; a server that knows nothing of ranges sends everything again.
"""

from __future__ import annotations

import http.client
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import IO, Any, TypeAlias

from dlama.errors import OutputError

Progress: TypeAlias = Callable[[int, int | None], None]

PIECE = 1 << 18


class Unusable(Exception):
    """This mirror did not give the file; the next one is tried."""


class _BrokeOff(Unusable):
    """The connection did, or there is none; what came is kept."""


def download(url: str, part: Path, size: int | None, progress: Progress | None, resume: bool) -> bool:
    """Make `part` the whole file at that address; True where it is not from one single reply.

    Args:
        url: http or https.
        part: what has arrived.
        size: bytes expected, None: unknown.
        progress: called with the bytes that have arrived and the bytes in all.
        resume: continue from what has arrived, and leave it there where the connection breaks.
    Raises:
        Unusable: this address does not give the file; in words why.
        OutputError: the disk cannot be written.
    """
    resumed = False
    try:
        for tries_left in (3, 2, 1, 0):
            start_at = _bytes_of(part) if resume else 0
            resumed = resumed or start_at > 0
            try:
                _fetch(url, part, start_at, size, progress)
                break
            except _BrokeOff:  # another try where this one brought something
                if not (resume and tries_left and _bytes_of(part) != start_at):
                    raise
    except BaseException as error:
        kept = isinstance(error, _BrokeOff) or not isinstance(error, Unusable)
        if not (resume and kept and _bytes_of(part)):  # only what a later pull continues from stays
            part.unlink(missing_ok=True)
        raise
    return resumed


def _fetch(url: str, part: Path, start_at: int, size: int | None, progress: Progress | None) -> None:
    """One request, from byte `start_at` on."""
    request = urllib.request.Request(url, headers={"User-Agent": "dlama", "Accept-Encoding": "identity"})
    if start_at:
        request.add_header("Range", f"bytes={start_at}-")
    with _name_failures(part), urllib.request.urlopen(request, timeout=30) as response:
        start, total = _announced(url, response, start_at, size)
        with _disk_errors(part):
            sink = part.open("ab" if start else "wb")
        with sink:
            done = _copy(response, sink, start, total, size, progress)
    if total is not None and done < total:
        raise _BrokeOff(f"broke off after {done} of {total} bytes; pulling again continues from there")
    if size is not None and done != size:
        raise Unusable(f"cut short: {done} bytes came, expected {size}")


def _copy(
    response: Any, sink: IO[bytes], done: int, total: int | None, size: int | None, progress: Progress | None
) -> int:
    """Bytes of the file that lie on the disk afterwards; `done` of `total` lie there before."""
    most = 4 << 30 if size is None else size
    while piece := _next_piece(response, total):
        done += len(piece)
        if done > most:
            raise Unusable(f"too long: more than {most} bytes came")
        with _disk_errors(Path(sink.name)):
            sink.write(piece)
        if progress:
            progress(done, total or size)
    return done


def _next_piece(response: Any, total: int | None) -> bytes:
    """Of the body; empty where that ends, or the connection does."""
    try:
        return bytes(response.read(PIECE))
    except (http.client.IncompleteRead, ConnectionError, TimeoutError):
        if total is None:
            raise _BrokeOff("broke off; the server did not announce the file's length") from None
        return b""


def _announced(url: str, response: Any, start_at: int, size: int | None) -> tuple[int, int | None]:
    """The first byte that the server sends, and those of the whole file; raises where it is plainly not the file."""
    if url.startswith("https:") and not response.geturl().startswith("https:"):
        raise Unusable(f"redirects from https to {response.geturl()}, which is not followed")
    headers = response.headers
    if headers.get_content_type() == "text/html" and "Content-Type" in headers:
        raise Unusable("a web page came instead of the file (moved, or a login is asked for)")
    length, start = headers.get("Content-Length", ""), start_at if response.status == HTTPStatus.PARTIAL_CONTENT else 0
    total = start + int(length) if length.isdecimal() else None
    if size is not None and total is not None and total != size:
        raise Unusable(f"{'cut short' if total < size else 'too long'}: {total} bytes are announced, expected {size}")
    return start, total


@contextmanager
def _name_failures(part: Path) -> Iterator[None]:
    try:
        yield
    except urllib.error.HTTPError as error:
        error.close()
        if error.code == HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            part.unlink(missing_ok=True)
            raise _BrokeOff("what had arrived before does not fit its file") from error
        words = {404: "moved or gone", 410: "gone", 401: "a login is asked for", 403: "access refused"}
        raise Unusable(f"{words.get(error.code, 'the server fails')} (HTTP {error.code})") from error
    except urllib.error.URLError as error:
        raise _BrokeOff(f"no connection ({error.reason})") from error
    except (ConnectionError, TimeoutError) as error:
        raise _BrokeOff(f"no connection ({error or type(error).__name__})") from error
    except http.client.HTTPException as error:
        raise Unusable(f"no HTTP server answers there ({type(error).__name__})") from error


@contextmanager
def _disk_errors(part: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"{part}: cannot be written ({error}); DLAMA_MODELS names another directory") from error


def _bytes_of(part: Path) -> int:
    return part.stat().st_size if part.is_file() else 0
