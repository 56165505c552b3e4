"""`dlama serve`: an address in; the page there, until the command is ended, out."""

from __future__ import annotations

import json
import secrets
import socket
import threading
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

from dlama.apps.options import Report, option
from dlama.apps.terminal.output import report_result
from dlama.errors import InputError
from dlama.web.answers import Limits

if TYPE_CHECKING:
    from dlama.web.server import Server


def serve(
    report: Report,
    host: Annotated[str, option("ADDRESS", "127.0.0.1")] = "127.0.0.1",
    port: Annotated[int, option("N", "7860")] = 7860,
    token: Annotated[str | None, option("TEXT", "one is made where other machines can reach the page")] = None,
    max_megabytes: Annotated[int, option("MB", "64")] = 64,
    max_megapixels: Annotated[float, option("MP", "16")] = 16.0,
    max_pages: Annotated[int, option("N", "8")] = 8,
) -> None:
    """A page in the browser: mark an object, move the camera, complete, look at it in 3-D, download everything.

    Args:
        host: Where to listen. 127.0.0.1: this machine alone; 0.0.0.0: every machine that can reach this one, with a token.
        port: The port; 0: a free one.
        token: The page is shown only to addresses that contain it; it is printed as part of the address.
        max_megabytes: The largest file that is taken.
        max_megapixels: The largest picture that is taken, in millions of pixels.
        max_pages: How many pages can be open at once; each holds its pictures in memory.
    """
    for name, value in (("max_megabytes", max_megabytes), ("max_megapixels", max_megapixels), ("max_pages", max_pages)):
        if not value > 0:
            raise InputError(f"`{name}` is {value:g}; more than 0 is expected")
    from dlama.web.server import is_loopback, open_server

    if token is None and not is_loopback(host):
        if report.quiet:
            raise InputError(
                f"`host` is {host} and `quiet` is on: the token that is made would not be printed; give `token`"
            )
        token = secrets.token_urlsafe(16)
    limits = Limits(max_megabytes, max_megapixels, max_pages)
    with report_result("serve", report), open_server(host, port, token, limits) as server:
        address = address_of(host, server.port, token)
        if report.json:
            print(json.dumps({"verb": "serve", "address": address}), flush=True)
        elif not report.quiet:
            print(f"{address}  (Ctrl-C ends it)", flush=True)
        serve_until_interrupted(server)


def serve_until_interrupted(server: Server) -> None:
    """Connections are taken in a thread of their own: a signal raises in the main one, where it interrupts the wait alone (in the
    midst of taking a connection it ended that, and the server continued)."""
    thread = threading.Thread(target=server.serve_forever, name="dlama serve", daemon=True)
    try:
        thread.start()
        while thread.is_alive():
            thread.join(1.0)  # on Windows Ctrl-C is noticed between waits alone
    except KeyboardInterrupt:
        server.shutdown()


def address_of(host: str, port: int, token: str | None) -> str:
    """What is typed into the browser; a host that means every address of this machine is called by its name."""
    name = socket.gethostname() if host in ("0.0.0.0", "::", "") else f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/" + (f"?token={quote(token)}" if token else "")
