"""Pulling from servers that behave, break off, lie, move and serve something else (oracle: the bytes that were served)."""

from __future__ import annotations

import errno
import hashlib
import json
import re
import socket
import urllib.request
from pathlib import Path

import pytest
from toy_server import Server, Site

from dlama.errors import FileError, OutputError
from dlama.models.pull import pull
from dlama.models.records import Record

BODY = bytes(range(256)) * 4000
WRONG = BODY[:-1] + b"!"


def a_record(*urls: str, known: bool = True) -> Record:
    """A record of BODY at those addresses."""
    sha256, size = (hashlib.sha256(BODY).hexdigest(), len(BODY)) if known else (None, None)
    return Record("toy", "a toy", urls, sha256, size, "MIT", "lama-weights", "toy.pt")


def refused(expected: Record) -> str:
    """The message with which it is refused, after checking that it says the way by hand and nothing was put in place."""
    with pytest.raises(FileError) as caught:
        pull(expected)
    message = str(caught.value)
    assert "\n" not in message
    assert "By hand: download" in message and "toy.pt, then `dlama models verify toy`" in message
    return message


def leftovers(cache_dir: Path) -> list[str]:
    """What lies in the cache directory."""
    return sorted(path.name for path in cache_dir.iterdir())


@pytest.mark.parametrize("chunked", [False, True])
def test_a_good_server(server: Server, cache_dir: Path, chunked: bool) -> None:
    """The bytes arrive by a redirection, of a length that is announced or not, as hubs do; progress ends at the whole, nothing
    else is left, and a second pull asks nobody."""
    seen: list[tuple[int, int | None]] = []
    there = server.add("/there", Site(BODY, chunked=chunked))
    expected = a_record(server.add("/a", Site(status=302, to=there)))
    path = pull(expected, lambda done, total: seen.append((done, total)))
    assert path == cache_dir / "toy.pt" and path.read_bytes() == BODY
    assert seen[-1] == (len(BODY), len(BODY)) and seen == sorted(seen)
    assert leftovers(cache_dir) == ["toy.pt"]
    pull(expected)
    assert len(server.asked) == 2


def test_redirects_from_https_to_http_are_not(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: what began encrypted does not end in the clear. The reply is this server's own, so its address is http."""
    opened = urllib.request.urlopen

    def redirected(request: urllib.request.Request, timeout: float) -> object:
        return opened(request.full_url.replace("https:", "http:"), timeout=timeout)

    monkeypatch.setattr(urllib.request, "urlopen", redirected)
    address = server.add("/a", Site(BODY)).replace("http:", "https:")
    assert "redirects from https to http://" in refused(a_record(address))


def test_continues_where_it_broke_off(server: Server) -> None:
    """Within one pull: the second request asks for the rest only."""
    pulled = pull(a_record(server.add("/a", Site(BODY, stops_after=[300_000, 400_000]))))
    assert pulled.read_bytes() == BODY
    assert [asked for _, asked in server.asked] == [None, "bytes=300000-", "bytes=700000-"]


def test_a_later_pull_continues(server: Server, cache_dir: Path) -> None:
    """Even after giving up: the .part file is kept, and used by the next pull."""
    url = server.add("/a", Site(BODY, stops_after=[100_000, 0]))
    assert "broke off after 100000 of 1024000 bytes; pulling again continues from there" in refused(a_record(url))
    assert (cache_dir / "toy.pt.part").read_bytes() == BODY[:100_000]
    assert pull(a_record(url)).read_bytes() == BODY
    assert server.asked[-1][1] == "bytes=100000-"
    assert leftovers(cache_dir) == ["toy.pt"]


def test_a_server_without_ranges_sends_all_again(server: Server) -> None:
    """Nothing of the first reply is left in the file."""
    url = server.add("/a", Site(BODY, stops_after=[300_000], ranges=False))
    assert pull(a_record(url)).read_bytes() == BODY
    assert len(server.asked) == 2


def test_a_file_that_changed_meanwhile_is_not_glued(server: Server) -> None:
    """Nothing tells whether a file of unknown hash is whole: the old half is not continued with the new one."""
    url = server.add("/a", Site(b"x" * len(BODY), stops_after=[100_000, 0]))
    refused(a_record(url, known=False))
    server.sites["/a"] = Site(BODY)
    assert pull(a_record(url, known=False)).read_bytes() == BODY


@pytest.mark.parametrize("part", [b"?" * 100_000, BODY, BODY + b"?" * 9], ids=["damaged", "whole", "too long"])
def test_a_part_file_that_is_of_no_use(server: Server, cache_dir: Path, part: bytes) -> None:
    """A resumed file has the wrong hash, or the server answers 416: it is pulled once more, from its start."""
    url = server.add("/a", Site(BODY, stops_after=[100_000, 0]))
    refused(a_record(url))
    (cache_dir / "toy.pt.part").write_bytes(part)
    assert pull(a_record(url)).read_bytes() == BODY


@pytest.mark.parametrize(
    ("site", "message"),
    [
        (Site(status=404), r"moved or gone \(HTTP 404\)"),
        (Site(status=410), r"gone \(HTTP 410\)"),
        (Site(b"<html>log in</html>", kind="text/html"), r"a web page came instead of the file"),
        (Site(status=403), r"access refused \(HTTP 403\)"),
        (Site(status=500), r"the server fails \(HTTP 500\)"),
        (Site(WRONG), r"corrupted or replaced: sha256 is [0-9a-f]{64}, expected [0-9a-f]{64}"),
        (Site(BODY[:-9]), r"cut short: 1023991 bytes are announced, expected 1024000"),
        (Site(BODY + b"?"), r"too long: 1024001 bytes are announced, expected 1024000"),
        (Site(BODY, announced=len(BODY) - 1), r"cut short: 1023999 bytes are announced"),
        (Site(BODY, announced=len(BODY) + 7), r"too long: 1024007 bytes are announced"),
        (Site(BODY[:-9], announced=-1), r"cut short: 1023991 bytes came, expected 1024000"),
        (Site(BODY + b"?", announced=-1), r"too long: more than 1024000 bytes came"),
        (Site(BODY, chunked=True, stops_after=[500_000] * 4, ranges=False), r"broke off; the server did not announce"),
        (Site(BODY[:-9], announced=len(BODY), ranges=False), r"broke off after 1023991 of 1024000 bytes"),
    ],
)
def test_servers_that_do_not_give_the_file(server: Server, cache_dir: Path, site: Site, message: str) -> None:
    """Each has its own words; only what the next pull continues from is left behind."""
    reported = refused(a_record(server.add("/a", site)))
    assert re.search(message, reported), reported
    assert leftovers(cache_dir) == (["toy.pt.part"] if "broke off" in message else [])


def test_a_full_disk_leaves_nothing_that_is_of_no_use(
    server: Server, cache_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Law: the first write fails, so there is nothing to continue from (oracle: what lies in the directory)."""

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("dlama.models.download._copy", full)
    with pytest.raises(OSError, match="No space left"):
        pull(a_record(server.add("/a", Site(BODY))))
    assert leftovers(cache_dir) == []


def test_offline() -> None:
    """Nobody listens there."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{free.getsockname()[1]}/a"
    assert "no connection (" in refused(a_record(url, url))


def test_mirrors_in_order(server: Server) -> None:
    """The first that gives the right file wins; when none does, each is named with what it did."""
    gone, wrong = server.add("/gone", Site(status=404)), server.add("/wrong", Site(WRONG))
    good, unused = server.add("/good", Site(BODY)), server.add("/unused", Site(BODY))
    assert pull(a_record(gone, wrong, good, unused)).read_bytes() == BODY
    assert [path for path, _ in server.asked] == ["/gone", "/wrong", "/good"]
    (pull(a_record(good))).unlink()
    reported = refused(a_record(gone, wrong))
    assert re.search("no mirror gave the right file.*/gone: moved.*/wrong: corrupted", reported)


def test_a_bad_file_in_the_cache_is_replaced(server: Server, cache_dir: Path) -> None:
    """Only by a good one: with a bad server it stays, with a good one it goes."""
    cache_dir.mkdir()
    (cache_dir / "toy.pt").write_bytes(b"old")
    expected = a_record(server.add("/a", Site(WRONG)))
    refused(expected)
    assert (cache_dir / "toy.pt").read_bytes() == b"old"
    server.sites["/a"] = Site(BODY)
    assert pull(expected).read_bytes() == BODY


def test_an_unknown_hash_is_pinned(server: Server, cache_dir: Path) -> None:
    """The first pull writes it down; another file under that address is refused from then on."""
    expected = a_record(server.add("/a", Site(BODY)), known=False)
    path = pull(expected)
    pins = json.loads((cache_dir / "pins.json").read_text())
    assert pins == {"toy.pt": {"sha256": hashlib.sha256(BODY).hexdigest(), "bytes": len(BODY)}}
    path.unlink()
    server.sites["/a"] = Site(WRONG)
    assert "pinned when it was first used; remove its entry in pins.json" in refused(expected)
    assert not path.exists()


def test_a_cache_directory_that_cannot_be_written(server: Server, cache_dir: Path) -> None:
    """Not a fault of the mirror: said at once, naming the directory and the variable."""
    cache_dir.write_text("a file")
    with pytest.raises(OutputError, match="DLAMA_MODELS names another directory"):
        pull(a_record(server.add("/a", Site(BODY))))
    assert server.asked == []
