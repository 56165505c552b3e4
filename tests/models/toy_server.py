"""A web server on this machine whose every address behaves in its own way."""

from __future__ import annotations

import contextlib
import threading
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass
class Site:
    """What one address serves, and how."""

    body: bytes = b""
    status: int = 200
    announced: int | None = None
    """Content-Length, where it is not the truth; -1: none at all."""
    stops_after: list[int] = field(default_factory=list)
    """The n-th reply breaks off after that many bytes of it."""
    ranges: bool = True
    kind: str = "application/octet-stream"
    to: str = ""
    chunked: bool = False


class Server:
    """Addresses by path; remembers the Range header of every request."""

    def __init__(self) -> None:
        self.sites: dict[str, Site] = {}
        self.asked: list[tuple[str, str | None]] = []
        outer = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_GET(self) -> None:
                outer.asked.append((self.path, self.headers.get("Range")))
                _answer(self, outer.sites[self.path])

            def log_message(self, *_: object) -> None:
                """Nothing on the terminal."""

        self.httpd = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.root = f"http://127.0.0.1:{self.httpd.server_port}"
        threading.Thread(target=self.httpd.serve_forever, args=(0.01,), daemon=True).start()

    def add(self, path: str, site: Site) -> str:
        """The full address of that site."""
        self.sites[path] = site
        return self.root + path


def _answer(handler: BaseHTTPRequestHandler, site: Site) -> None:
    start = 0
    asked = handler.headers.get("Range")
    if site.ranges and asked:
        start = int(asked.removeprefix("bytes=").removesuffix("-"))
        if start >= len(site.body):
            handler.send_response(416)
            handler.send_header("Content-Length", "0")
            handler.end_headers()
            return
    body = site.body[start:]
    handler.send_response(206 if start else site.status)
    if start:
        handler.send_header("Content-Range", f"bytes {start}-{len(site.body) - 1}/{len(site.body)}")
    if site.to:
        handler.send_header("Location", site.to)
    handler.send_header("Content-Type", site.kind)
    if site.chunked:
        handler.send_header("Transfer-Encoding", "chunked")
    elif site.announced != -1:
        handler.send_header("Content-Length", str(len(body) if site.announced is None else site.announced))
    handler.send_header("Connection", "close")
    handler.end_headers()
    cut = site.stops_after.pop(0) if site.stops_after else len(body)
    body = b"%x\r\n%b\r\n" % (len(body), body[:cut]) + b"0\r\n\r\n" * (cut == len(body)) if site.chunked else body[:cut]
    with contextlib.suppress(ConnectionError):  # who had read enough has hung up
        handler.wfile.write(body)
    handler.close_connection = True
