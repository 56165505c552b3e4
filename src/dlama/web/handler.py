"""One connection of a browser in; the page, its files and the answers of `api` out.

Who may ask: only pages of this server (every request of the API carries a header that no other site can send), only under this
machine's own names while the server listens on it alone, and, where a token is asked for, only who has it.
"""

from __future__ import annotations

import hashlib
import hmac
import http.cookies
import json
import traceback
from collections.abc import Mapping
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import parse_qs, unquote, urlsplit

from dlama.errors import DlamaError, FileError, system_reason
from dlama.web import api
from dlama.web.answers import Blob, Limits, PageError, field_of, hide_paths, use_page_words
from dlama.web.visits import Visit, Visits

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
TEXT = "text/plain; charset=utf-8"
MOST_JSON = 2**20
"""Bytes of a request's fields."""
CHUNK = 2**18
SECONDS = 60
"""A connection without a request for so long is closed."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
"""What the browser lets the page load: nothing from anywhere else."""
LOOPBACK = ("localhost", "127.0.0.1", "::1")
ASK_FOR_TOKEN = """<!doctype html><html lang="en"><meta charset="utf-8"><title>dlama</title>
<meta name="viewport" content="width=device-width"><link rel="stylesheet" href="/page.css">
<main class="gate"><h1>dlama</h1><p>This page asks for the token that <code>dlama serve</code> printed.</p>
<form><label for="token">Token</label><input id="token" name="token" type="password" autocomplete="off" autofocus>
<button class="primary">Open</button></form></main></html>
"""


class ServerState(Protocol):
    """What a connection needs to know of its server."""

    visits: Visits
    token: str | None
    limits: Limits
    files: Mapping[str, bytes]

    @property
    def port(self) -> int:
        """Where it listens."""

    @property
    def local(self) -> bool:
        """Whether this machine alone reaches it."""


class Handler(BaseHTTPRequestHandler):
    """One connection of a browser."""

    protocol_version = "HTTP/1.1"
    server_version = "dlama"
    sys_version = ""
    timeout = SECONDS
    server: ServerState  # type: ignore[assignment]

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing of what visitors do is written down."""

    def parse_request(self) -> bool:
        """As the standard library's; an address or a host that is none, as scanners of networks send, is refused, too."""
        if not super().parse_request():
            return False
        try:
            urlsplit(self.path)
            urlsplit(f"//{self.headers.get('Host', '')}")
        except ValueError:
            self.send_error(HTTPStatus.BAD_REQUEST)
            return False
        return True

    def do_GET(self) -> None:
        """The page and its files."""
        address = urlsplit(self.path)
        given = parse_qs(address.query).get("token", [""])[0]
        if not self._host_is_ours():
            self._reply(HTTPStatus.FORBIDDEN, b"this address is not one that dlama serve listens on", TEXT)
        elif self.server.token and given and equal_tokens(given, self.server.token):
            cookie = f"{self._cookie_name()}={digest(self.server.token)}; Path=/; HttpOnly; SameSite=Strict"
            self._reply(HTTPStatus.SEE_OTHER, b"", TEXT, {"Location": "/", "Set-Cookie": cookie})
        elif not self._has_token() and address.path != "/page.css":
            self._reply(HTTPStatus.UNAUTHORIZED, ASK_FOR_TOKEN.encode(), TYPES[".html"])
        else:
            name = "/page.html" if address.path == "/" else address.path
            data = self.server.files.get(name)
            if data is None:
                self._reply(HTTPStatus.NOT_FOUND, b"there is no such page", TEXT)
            else:
                self._reply(HTTPStatus.OK, data, TYPES[Path(name).suffix])

    do_HEAD = do_GET

    def do_POST(self) -> None:
        """Uploads and actions."""
        address = urlsplit(self.path)
        number = self.headers.get("X-Dlama-Visit")
        if not self._host_is_ours() or not self._has_token():
            self._refuse(HTTPStatus.UNAUTHORIZED, "this page asks for a token; open it anew")
        elif number is None and address.path != "/api/leave":
            self._refuse(HTTPStatus.FORBIDDEN, "requests of other pages are not answered")
        else:
            self._answer(address.path.removeprefix("/api/"), parse_qs(address.query), number or "")

    def _answer(self, action: str, query: Mapping[str, list[str]], number: str) -> None:
        """What the page of the visit with that number asks for, or why it cannot be had."""
        visit: Visit | None = None
        try:
            if action == "leave":
                self.server.visits.leave(self._body(most=200).decode("ascii", "replace"))
                self._json({})
            elif action in ("visit", "settings"):  # a new one, or what the page is set up by
                self._body(MOST_JSON)
                begins = action == "visit"
                self._json({"visit": self.server.visits.begin().id} if begins else api.settings(self.server.limits))
            else:
                visit = self.server.visits.find(number)
                self._act(visit, action, query)
        except DlamaError as error:
            self._failed(error, visit)
        except MemoryError:
            self._refuse(HTTPStatus.BAD_REQUEST, "this machine's memory is too small for that; take a smaller picture")
        except (ConnectionError, TimeoutError):  # the visitor's end
            raise
        except OSError as error:  # of this machine's disk: full, read-only, broken
            reason = system_reason(error)
            self._refuse(HTTPStatus.INSUFFICIENT_STORAGE, f"the server cannot keep that: {reason}")
        except Exception as error:
            traceback.print_exc()
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, f"a fault of dlama: {type(error).__name__}: {error}")

    def _act(self, visit: Visit, name: str, query: Mapping[str, list[str]]) -> None:
        if name == "upload":
            role = query.get("role", [""])[0]
            given = unquote(self.headers.get("X-Name", ""))
            self._json(api.keep_upload(visit, role, given, self.server.limits, self._stream))
            return
        action = api.ACTIONS.get(name)
        if action is None:
            raise PageError("there is no such action", status=404)
        fields = self._fields()
        if name in api.UNLOCKED:
            answer = action(visit, fields)
        else:
            with visit.lock:
                if visit.closed:
                    raise PageError("this page was closed; start again", status=410)
                answer = action(visit, fields)
        if isinstance(answer, Blob):
            named = {"Content-Disposition": f'attachment; filename="{answer.name}"'} if answer.name else {}
            self._reply(HTTPStatus.OK, answer.data, answer.kind, {**(answer.headers or {}), **named})
        else:
            self._json(answer)

    def _fields(self) -> dict[str, Any]:
        body = self._body(MOST_JSON)
        try:
            fields = json.loads(body or b"{}")
        except (ValueError, RecursionError):
            raise PageError("the fields are no JSON") from None
        if not isinstance(fields, dict):
            raise PageError("the fields are no JSON object")
        return fields

    def _length(self, most: int) -> int:
        given = self.headers.get("Content-Length") or "0"
        # int() takes no number of any length
        if "Transfer-Encoding" in self.headers or not given.isdecimal() or len(given) > 18:
            self.close_connection = True
            raise PageError("the length of what is sent must be given", status=411)
        if int(given) > most:
            self.close_connection = True
            self._drop(min(int(given), 4 * most))  # a browser reads the answer only once it has sent all
            raise PageError(f"that is {int(given) / 2**20:.0f} MB; up to {most / 2**20:.0f} MB are taken", status=413)
        return int(given)

    def _drop(self, left: int) -> None:
        while left > 0:
            part = self.rfile.read(min(CHUNK, left))
            if not part:
                return
            left -= len(part)

    def _body(self, most: int) -> bytes:
        return self.rfile.read(self._length(most))

    def _stream(self, file: Any) -> None:
        left = self._length(self.server.limits.bytes)
        if not left:
            raise FileError(f"{file.name}: is empty (0 bytes)")
        while left:
            part = self.rfile.read(min(CHUNK, left))
            if not part:
                raise FileError(f"{file.name}: the upload was broken off")
            file.write(part)
            left -= len(part)

    def _failed(self, error: DlamaError, visit: Visit | None) -> None:
        files = {role: upload.path for role, upload in visit.files.items()} if visit else {}
        names = visit.names() if visit else {}
        status = error.status if isinstance(error, PageError) else 400
        field = field_of(error, files)
        if not field and self.path.startswith("/api/upload"):
            field = parse_qs(urlsplit(self.path).query).get("role", [""])[0][:20]
        self.close_connection = True  # its body may not have been read
        self._json({"error": use_page_words(hide_paths(error.marked, names)), "field": field}, HTTPStatus(status))

    def _refuse(self, status: HTTPStatus, message: str) -> None:
        self.close_connection = True
        self._json({"error": message, "field": ""}, status)

    def _json(self, values: Mapping[str, Any], status: HTTPStatus = HTTPStatus.OK) -> None:
        self._reply(status, json.dumps(values).encode(), "application/json")

    def _reply(self, status: HTTPStatus, data: bytes, kind: str, headers: Mapping[str, str] | None = None) -> None:
        self.send_response(status)
        always = {
            "Content-Type": kind,
            "Content-Length": str(len(data)),
            "Cache-Control": "no-store",
            "Content-Security-Policy": POLICY,
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
        }
        for name, value in {**always, **(headers or {})}.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    def _host_is_ours(self) -> bool:
        host = urlsplit(f"//{self.headers.get('Host', '')}").hostname or ""
        return not self.server.local or host in LOOPBACK

    def _cookie_name(self) -> str:
        return f"dlama-{self.server.port}"

    def _has_token(self) -> bool:
        if not self.server.token:
            return True
        cookies = http.cookies.SimpleCookie()
        with suppress(http.cookies.CookieError):
            cookies.load(self.headers.get("Cookie", ""))
        given = cookies.get(self._cookie_name())
        bearer = self.headers.get("Authorization", "").removeprefix("Bearer ")
        return (
            equal_tokens(given.value, digest(self.server.token)) if given else equal_tokens(bearer, self.server.token)
        )


def digest(token: str) -> str:
    """What the cookie holds: a token may have signs that cookies cannot hold."""
    return hashlib.sha256(token.encode()).hexdigest()


def equal_tokens(given: str, token: str) -> bool:
    """Whether two texts are equal, in a time that does not depend on where they differ."""
    return hmac.compare_digest(given.encode("utf-8", "replace"), token.encode())
