"""An address in; its file, as long as the server announced, out, or in words why this mirror does not give it."""

from __future__ import annotations

import http.client
import re
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from dlama.errors import OutputError

Progress: TypeAlias = Callable[[int, int | None], None]

PIECE = 1 << 18
LONGEST = 4 << 30


class Unusable(Exception):
    """This mirror did not give the file; the next one is tried."""


class Moved(Unusable):
    """The file is not at this address any more."""


class Offline(Unusable):
    """There is no connection to this address."""


def download(url: str, part: Path, size: int | None, progress: Progress | None, timeout: float) -> None:
    """Make `part` the whole file at that address; nothing is left of a failure.

    Args:
        url: http or https.
        size: bytes expected, None: unknown.
        progress: called with the bytes that have arrived and the bytes in all.
        timeout: seconds a server may be silent.
    Raises:
        Unusable: this address does not give the file; in words why.
        OutputError: the disk cannot be written.
    """
    request = urllib.request.Request(url, headers={"User-Agent": "dlama", "Accept-Encoding": "identity"})
    try:
        with _name_failures(), urllib.request.urlopen(request, timeout=timeout) as response:
            total = _announced(url, response, size)
            done = 0
            with _disk_errors(part):
                sink = part.open("wb")
            with sink:
                for piece in _pieces(response, total):
                    done += len(piece)
                    if done > (LONGEST if size is None else size):
                        raise Unusable(f"too long: more than {LONGEST if size is None else size} bytes came")
                    with _disk_errors(part):
                        sink.write(piece)
                    if progress:
                        progress(done, total or size)
        if total is not None and done < total:
            raise Unusable(f"broke off after {done} of {total} bytes")
        if size is not None and done != size:
            raise Unusable(f"cut short: {done} bytes came, expected {size}")
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _announced(url: str, response: Any, size: int | None) -> int | None:
    """Bytes that the headers announce; raises where it is plainly not the file."""
    headers = response.headers
    if url.startswith("https:") and not response.geturl().startswith("https:"):
        raise Unusable(f"redirects from https to {response.geturl()}, which is not followed")
    if headers.get_content_type() == "text/html" and "Content-Type" in headers:
        raise Moved("a web page came instead of the file (moved, or a login is asked for)")
    length = headers.get("Content-Length", "")
    total = int(length) if length.isdecimal() else None
    if size is not None and total is not None and total != size:
        raise Unusable(f"{'cut short' if total < size else 'too long'}: {total} bytes are announced, expected {size}")
    return total


def _pieces(response: Any, total: int | None) -> Iterator[bytes]:
    """The body as it comes; ends early where the connection does."""
    first = True
    while True:
        try:
            piece = response.read(PIECE)
        except (http.client.IncompleteRead, ConnectionError, TimeoutError):
            if total is None:
                raise Unusable("broke off; the server did not announce the file's length") from None
            return
        if not piece:
            return
        if first and re.match(rb"\s*<(!doctype\s+html|html)", piece[:256], re.IGNORECASE):
            raise Moved("a web page came instead of the file (moved, or a login is asked for)")
        first = False
        yield piece


@contextmanager
def _name_failures() -> Iterator[None]:
    try:
        yield
    except urllib.error.HTTPError as error:
        error.close()
        kind = Moved if error.code in (404, 410) else Unusable
        words = {404: "moved or gone", 410: "gone", 401: "a login is asked for", 403: "access refused"}
        raise kind(f"{words.get(error.code, 'the server fails')} (HTTP {error.code})") from error
    except urllib.error.URLError as error:
        raise Offline(f"no connection ({error.reason})") from error
    except (ConnectionError, TimeoutError) as error:
        raise Offline(f"no connection ({error or type(error).__name__})") from error
    except http.client.HTTPException as error:
        raise Unusable(f"no HTTP server answers there ({type(error).__name__})") from error


@contextmanager
def _disk_errors(part: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"{part}: cannot be written ({error}); DLAMA_MODELS names another directory") from error
