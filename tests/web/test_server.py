"""What the server answers, and to whom (oracles: the rules of HTTP, and what lies on disk)."""

from __future__ import annotations

import errno
import http.client
import io
import json
import os
import subprocess
import sys
import threading
import zipfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from box_frame import small_frame
from dlama.errors import InputError
from dlama.web.answers import Limits
from dlama.web.server import Server, open_server


def ask(
    server: Server, method: str, path: str, body: bytes | dict[str, Any] = b"", **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of one request; `_` of a header's name stands for a dash."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=600)
    data = json.dumps(body).encode() if isinstance(body, dict) else body
    connection.request(method, path, data, {name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


class Page:
    """An open page, as a browser's."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self.visit = ""
        self.visit = self.post("visit")["visit"]

    def post(self, action: str, body: bytes | dict[str, Any] = b"{}", status: int = 200, **headers: str) -> Any:
        """JSON or bytes of an action."""
        code, reported, data = ask(self.server, "POST", f"/api/{action}", body, X_Dlama_Visit=self.visit, **headers)
        assert code == status, data
        return json.loads(data) if reported["Content-Type"] == "application/json" else data

    def upload(self, role: str, data: bytes, name: str, status: int = 200) -> Any:
        """A file."""
        return self.post(f"upload?role={role}", data, status, X_Name=name)


def open_frame(page: Page, frame: Path) -> None:
    """The small frame's picture and depth, read."""
    page.upload("picture", (frame / "image.png").read_bytes(), "image.png")
    page.upload("depth", (frame / "depth.png").read_bytes(), "depth.png")
    page.post("read", {"fov": "60"})


def test_page_and_its_files_come_from_this_server_alone(server: Server) -> None:
    """Each comes with the policy that forbids everything else; no address of another host stands in them."""
    for path, kind in (("/", "text/html"), ("/page.js", "text/javascript"), ("/page.css", "text/css")):
        status, headers, data = ask(server, "GET", path)
        assert status == 200 and headers["Content-Type"].startswith(kind)
        assert headers["Content-Security-Policy"].startswith("default-src 'none'")
        assert b"//" not in data.replace(b"http://www.w3.org/", b"").replace(b"//\n", b"") or b"https:" not in data


@pytest.mark.parametrize(
    "path",
    ["/../server.py", "/%2e%2e/server.py", "//etc/passwd", "/etc/passwd", "/page.css/..", "/.git", "/api/zip", "/page"],
)
def test_no_path_is_opened(server: Server, path: str) -> None:
    """Only the page's own files have addresses."""
    assert ask(server, "GET", path)[0] == 404


def test_only_pages_of_this_server_are_answered(server: Server) -> None:
    """Without the page's header (which no other site can send), from another host's name, with another method: refused."""
    assert ask(server, "POST", "/api/visit", b"{}")[0] == 403
    assert ask(server, "POST", "/api/visit", b"{}", X_Dlama_Visit="", Host="evil.example")[0] == 401
    assert ask(server, "GET", "/", Host="evil.example:80")[0] == 403
    assert ask(server, "GET", "/", Host=f"localhost:{server.port}")[0] == 200
    assert ask(server, "OPTIONS", "/api/visit")[0] == 501
    assert len(server.visits) == 0


def test_what_is_no_host_is_answered(server: Server, capsys: pytest.CaptureFixture[str]) -> None:
    """A host that no URL can have gets 400, and the terminal shows no traceback (oracle: RFC 9112, 3.2)."""
    assert ask(server, "GET", "/", Host="[bad")[0] == 400
    assert ask(server, "POST", "/api/visit", b"{}", X_Dlama_Visit="", Host="[bad")[0] == 400
    assert not capsys.readouterr().err


def test_a_token_is_asked_for(temporary: Path) -> None:
    """With one, nothing is answered without it; its address sets a cookie that opens the page."""
    with pytest.raises(InputError, match="give token"), open_server("0.0.0.0", 0, None, Limits()):
        pass
    with open_server("127.0.0.1", 0, "secret", Limits()) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        assert ask(server, "GET", "/")[0] == 401
        assert ask(server, "GET", "/page.js")[0] == 401
        assert ask(server, "GET", "/?token=wrong")[0] == 401
        assert ask(server, "POST", "/api/visit", b"{}", X_Dlama_Visit="")[0] == 401
        status, headers, _ = ask(server, "GET", "/?token=secret")
        assert (status, headers["Location"]) == (303, "/")
        cookie = headers["Set-Cookie"]
        assert "HttpOnly" in cookie and "SameSite=Strict" in cookie
        opened = cookie.partition(";")[0]
        assert ask(server, "GET", "/", Cookie=opened)[0] == 200
        assert ask(server, "POST", "/api/visit", b"{}", Cookie=opened, X_Dlama_Visit="")[0] == 200
        assert ask(server, "POST", "/api/visit", b"{}", Cookie="dlama-1=secret", X_Dlama_Visit="")[0] == 401
        server.shutdown()


def test_what_was_said_of_picture_and_mask_is_said_again(server: Server, frame: Path) -> None:
    """To a page that is loaded again (oracle: what was answered first)."""
    picture = cv2.cvtColor(cv2.imread(str(frame / "image.png")), cv2.COLOR_BGR2BGRA)
    picture[0, 0, 3] = 0
    cv2.imwrite(str(frame / "image.png"), picture)
    page = Page(server)
    open_frame(page, frame)
    (warned,) = page.post("read", {"fov": 60})["warnings"]
    marked = page.post("mark", {"marks": [{"kind": "click", "at": [30, 24]}]})
    state = page.post("state")
    assert "alpha is dropped" in warned and state["warnings"] == [warned] and state["marked"] == marked


def test_a_port_that_is_taken(server: Server) -> None:
    """One line says which."""
    reported = f"host is 127.0.0.1, port is {server.port}: .*give another host or port"
    with pytest.raises(InputError, match=reported), open_server("127.0.0.1", server.port, None, Limits()):
        pass


def test_all_of_a_visit(server: Server, frame: Path, temporary: Path) -> None:
    """Hand in, mark, preview, complete, take home; then nothing of it is left on disk."""
    page = Page(server)
    open_frame(page, frame)
    assert page.post("mark", {"marks": [{"kind": "click", "at": [30, 24]}]})["share"] > 0.05
    for action, fields in (("mask", {}), ("source", {}), ("source", {"kind": "depth"}), ("preview", {"yaw": 5})):
        assert page.post(action, fields).startswith(b"\x89PNG")
    page.post("complete", {"yaw": 5, "filler": "telea"})
    while (reported := page.post("run"))["state"] in ("waiting", "running"):
        pass
    assert reported["state"] == "done" and reported["result"]["removed"]
    for kind in ("image", "known", "hole_type", "origin", "confidence", "depth", "depth_known", "source"):
        assert page.post("picture", {"kind": kind}).startswith(b"\x89PNG")
    assert page.post("pixel", {"x": 3, "y": 4})["depth"] == pytest.approx(4, abs=1)
    assert page.post("scene")[:4] == b"glTF"
    assert "out/meta.json" in zipfile.ZipFile(io.BytesIO(page.post("zip"))).namelist()
    assert page.post("state")["result"]["how"]["command"].startswith("dlama remove image.png depth.png --fov 60")
    assert [path.name for path in temporary.rglob("*.png")]
    server.visits.end(page.visit)
    assert list(temporary.rglob("*.*")) == list(temporary.iterdir())
    assert "start again" in page.post("state", status=410)["error"]


def test_two_visitors_are_apart(server: Server, frame: Path) -> None:
    """Neither sees the other's files, and a made-up number is nobody's."""
    first, second = Page(server), Page(server)
    open_frame(first, frame)
    assert second.post("state")["files"] == {}
    assert second.post("source", status=400)["field"] == "picture"
    assert first.visit != second.visit and len(first.visit) >= 32
    second.visit = first.visit[:-1] + ("a" if first.visit[-1] != "a" else "b")
    second.post("source", status=410)


def test_what_is_handed_in_is_bounded(server: Server, frame: Path) -> None:
    """Bytes, pixels, fields and pages; a refused file is not kept."""
    page = Page(server)
    assert "up to 1 MB are taken" in page.upload("picture", b"x" * (2**20 + 1), "a.png", 413)["error"]
    large = cv2.imencode(".png", np.zeros((1200, 1000, 3), np.uint8))[1].tobytes()
    reported = page.upload("picture", large, "large.png", 400)
    assert reported == {
        "error": "large.png: is 1000x1200 pixels; this page takes up to 1 million, scale it down or use the command line",
        "field": "picture",
    }
    assert page.upload("picture", b"", "a.png", 400)["error"] == "a.png: is empty (0 bytes)"
    assert page.post("state")["files"] == {}
    page.post("read", b"[" * 2**20 + b"]", status=413)
    page.post("read", b"[" * 10_000, status=400)
    Page(server), Page(server)
    status, _, data = ask(server, "POST", "/api/visit", b"{}", X_Dlama_Visit="")
    assert status == 503 and b"no more are taken" in data


def test_lengths_that_cannot_be_are_refused(server: Server, capfd: pytest.CaptureFixture[str]) -> None:
    """Law: an answer for each, and no traceback on the server's terminal."""
    assert ask(server, "POST", "/api/leave", b"x" * 300)[0] == 413
    for given in ("9" * 5000, "-1", "many"):
        assert ask(server, "POST", "/api/leave", b"", Content_Length=given)[0] == 411
        assert ask(server, "POST", "/api/visit", b"", Content_Length=given, X_Dlama_Visit="")[0] == 411
    assert capfd.readouterr().err == ""


def test_a_page_that_leaves_is_forgotten(server: Server, frame: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Soon after it says so, unless it comes back, as a page that is loaded again does."""
    page, other = Page(server), Page(server)
    open_frame(page, frame)
    server.visits.leave(page.visit)
    page.post("alive")
    monkeypatch.setattr("dlama.web.visits.LEAVING_SECONDS", -1.0)
    server.visits.sweep()
    page.post("alive")
    server.visits.leave(other.visit)
    server.visits.sweep()
    other.post("alive", status=410)


def test_a_visit_that_is_being_answered_keeps_nobody_waiting(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is forgotten once it has been answered; meanwhile the server continues."""
    page = Page(server)
    visit = server.visits.find(page.visit)
    held, go = threading.Event(), threading.Event()

    def answering() -> None:
        with visit.lock:
            held.set()
            go.wait(600)

    thread = threading.Thread(target=answering)
    thread.start()
    assert held.wait(600)
    monkeypatch.setattr("dlama.web.visits.LEAVING_SECONDS", -1.0)
    server.visits.leave(page.visit)
    assert ask(server, "GET", "/")[0] == 200 and len(server.visits) == 1
    go.set()
    thread.join()
    server.visits.sweep()
    assert len(server.visits) == 0


def test_a_killed_server_leaves_nothing_for_long(temporary: Path) -> None:
    """The folder of one that ended without removing it goes when the next begins (oracle: its name, its dead process)."""
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    with open_server("127.0.0.1", 0, None, Limits()) as server:
        name = server.visits.root.name
    left = temporary / name.replace(str(os.getpid()), str(dead.pid), 1)
    left.mkdir()
    (left / "picture.jpg").write_bytes(b"somebody's")
    with open_server("127.0.0.1", 0, None, Limits()):
        assert not left.exists()
    assert list(temporary.iterdir()) == []


def test_a_full_disk_is_said_and_leaves_nothing(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """An upload that cannot be kept is answered in words, its half is removed, and the next one is taken."""
    page, data = Page(server), (small_frame(tmp_path) / "image.png").read_bytes()

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("dlama.web.api.check_upload", full)
        reported = page.upload("picture", data, "image.png", status=507)
    assert reported == {"error": "the server cannot keep that: no space left on device", "field": ""}
    assert [path for path in server.visits.root.rglob("*") if path.is_file()] == [] and capfd.readouterr().err == ""
    page.upload("picture", data, "image.png")


ARENAS_OF_THREADS = """
import ctypes, sys, threading
from dlama.web.answers import Limits
from dlama.web.server import open_server
libc = ctypes.CDLL(None)
libc.malloc.restype, libc.fopen.restype = ctypes.c_void_p, ctypes.c_void_p
with open_server("127.0.0.1", 0, None, Limits()): pass
together = threading.Barrier(12)
def allocate():
    libc.malloc(1000)
    together.wait()
threads = [threading.Thread(target=allocate) for _ in range(12)]
for one in threads: one.start()
for one in threads: one.join()
stream = ctypes.c_void_p(libc.fopen(sys.argv[1].encode(), b"w"))
libc.malloc_info(0, stream)
libc.fclose(stream)
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="glibc alone has arenas that can be counted")
def test_threads_share_two_arenas(tmp_path: Path) -> None:
    """Oracle: glibc's own malloc_info, after twelve threads at once took memory; without the limit it lists one for each."""
    subprocess.run([sys.executable, "-c", ARENAS_OF_THREADS, str(tmp_path / "arenas.xml")], check=True)
    assert (tmp_path / "arenas.xml").read_text("ascii").count("<heap nr=") <= 2
