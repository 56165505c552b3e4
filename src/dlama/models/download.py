"""One address and a .part file in -> the .part file, as long as the server said, out; goes on where it had broken off.

Going on is asked for only from the address that the .part file came from, and only if the file there is still the same
(If-Range); a server that knows nothing of ranges sends everything again.
"""

from __future__ import annotations

import http.client
import json
import re
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, TypeAlias

from dlama.errors import OutputError

Progress: TypeAlias = Callable[[int, int | None], None]

PIECE = 1 << 18
LONGEST = 4 << 30
TRIES = 4
RANGE_REFUSED = 416
PARTIAL = 206


class Unusable(Exception):
    """This mirror did not give the file; the next one is tried."""


class Moved(Unusable):
    """The file is not at this address any more."""


class Offline(Unusable):
    """There is no connection to this address."""


class _BrokeOff(Unusable):
    """Less came than was announced; what came is kept."""


@dataclass(frozen=True)
class _Reply:
    """What the server announced."""

    start: int
    """First byte of the file that it sends."""
    total: int | None
    """Bytes of the whole file."""
    stamp: str
    """ETag or date that names this version of the file; empty where there is none."""


def download(url: str, part: Path, size: int | None, progress: Progress | None, timeout: float) -> bool:
    """Make `part` the whole file at that address; True where it is not from one single reply.

    Args:
        url: http or https.
        part: what has arrived; what it came from is noted beside it.
        size: bytes wanted, None: unknown.
        progress: called with the bytes that have arrived and the bytes in all.
        timeout: seconds a server may be silent.
    Raises:
        Unusable: this address does not give the file; in words why.
        OutputError: the disk cannot be written.
    """
    resumed, before = False, -1
    for _ in range(TRIES):
        have = _arrived(url, part)
        if have <= before:  # a whole try brought nothing
            break
        resumed = resumed or have > 0
        try:
            _fetch(url, part, have, size, progress, timeout)
        except _BrokeOff as error:
            broken = error
            before = have if part.is_file() else -1
        except Offline:  # what has arrived is kept for the next pull
            raise
        except Unusable:
            part.unlink(missing_ok=True)
            _note(part).unlink(missing_ok=True)
            raise
        else:
            _note(part).unlink(missing_ok=True)
            return resumed
    raise broken


def _fetch(url: str, part: Path, have: int, size: int | None, progress: Progress | None, timeout: float) -> None:
    """One request, from byte `have` on."""
    request = urllib.request.Request(url, headers={"User-Agent": "dlama", "Accept-Encoding": "identity"})
    stamp = _noted(part).get("stamp", "")
    if have and stamp:
        request.add_header("Range", f"bytes={have}-")
        request.add_header("If-Range", stamp)
    with _words_for_failures(part), urllib.request.urlopen(request, timeout=timeout) as answer:
        reply = _reply(url, answer, have, size)
        with _disk(part):
            _note(part).write_text(json.dumps({"url": url, "stamp": reply.stamp}), "utf-8")
            sink = part.open("r+b" if reply.start else "wb")
        with sink:
            sink.seek(reply.start)
            sink.truncate()
            done = _copy(answer, sink, reply, size, progress)
    if reply.total is not None and done < reply.total:
        raise _BrokeOff(f"broke off after {done} of {reply.total} bytes; pulling again goes on from there")
    if size is not None and done != size:
        raise Unusable(f"cut short: {done} bytes came, wanted {size}")


def _copy(answer: Any, sink: IO[bytes], reply: _Reply, size: int | None, progress: Progress | None) -> int:
    """Bytes of the file that lie on the disk afterwards."""
    done = reply.start
    for piece in _pieces(answer, reply):
        done += len(piece)
        if done > (LONGEST if size is None else size):
            raise Unusable(f"too long: more than {LONGEST if size is None else size} bytes came")
        with _disk(Path(sink.name)):
            sink.write(piece)
        if progress:
            progress(done, reply.total or size)
    return done


def _pieces(answer: Any, reply: _Reply) -> Iterator[bytes]:
    """The body as it comes; ends early where the connection does."""
    first = reply.start == 0
    while True:
        try:
            piece = answer.read(PIECE)
        except (http.client.IncompleteRead, ConnectionError, TimeoutError):
            if reply.total is None:
                raise _BrokeOff("broke off; the server had not said how long the file is") from None
            return
        if not piece:
            return
        if first and re.match(rb"\s*<(!doctype\s+html|html)", piece[:256], re.IGNORECASE):
            raise Moved("a web page came instead of the file (moved, or a login is asked for)")
        first = False
        yield piece


def _reply(url: str, answer: Any, have: int, size: int | None) -> _Reply:
    """What the headers announce; raises where it is plainly not the file."""
    headers = answer.headers
    if url.startswith("https:") and not answer.geturl().startswith("https:"):
        raise Unusable(f"redirects from https to {answer.geturl()}, which is not followed")
    if headers.get_content_type() == "text/html" and "Content-Type" in headers:
        raise Moved("a web page came instead of the file (moved, or a login is asked for)")
    stamp = headers.get("ETag", "")
    stamp = headers.get("Last-Modified", "") if not stamp or stamp.startswith("W/") else stamp
    length = headers.get("Content-Length", "")
    total = int(length) if length.isdecimal() else None
    start = 0
    if answer.status == PARTIAL:
        told = re.fullmatch(r"bytes (\d+)-\d+/(\d+|\*)", headers.get("Content-Range", "").strip())
        if told is None or int(told[1]) != have:
            raise Unusable(f"asked for the bytes from {have} on, it sends {headers.get('Content-Range', 'others')}")
        start, total = have, None if told[2] == "*" else int(told[2])
    if size is not None and total is not None and total != size:
        raise Unusable(f"{'cut short' if total < size else 'too long'}: {total} bytes are announced, wanted {size}")
    return _Reply(start, total, stamp)


@contextmanager
def _words_for_failures(part: Path) -> Iterator[None]:
    try:
        yield
    except urllib.error.HTTPError as error:
        error.close()
        if error.code == RANGE_REFUSED:
            part.unlink(missing_ok=True)
            raise _BrokeOff("what had arrived before does not fit its file") from error
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
def _disk(part: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"{part}: cannot be written ({error}); DLAMA_MODELS names another directory") from error


def _note(part: Path) -> Path:
    return part.with_name(part.name + ".json")


def _noted(part: Path) -> dict[str, str]:
    try:
        noted = json.loads(_note(part).read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return {str(key): str(value) for key, value in noted.items()} if isinstance(noted, dict) else {}


def _arrived(url: str, part: Path) -> int:
    """Bytes that came from that address before and can be gone on from."""
    noted = _noted(part)
    usable = part.is_file() and noted.get("url") == url and noted.get("stamp")
    return part.stat().st_size if usable else 0
