"""An address in; a server there that hands each connection to `handler`, and forgets its visits at the end, out.

Nothing but the standard library.
"""

from __future__ import annotations

import ctypes
import socket
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import ThreadingHTTPServer
from pathlib import Path
from typing import Any

from dlama.errors import InputError, system_reason
from dlama.web.answers import Limits
from dlama.web.completions.runs import warnings_by_thread
from dlama.web.handler import LOOPBACK, TYPES, Handler
from dlama.web.visits import Visits, open_visits

ASSETS = Path(__file__).parents[1] / "assets" / "web"
MOST_CONNECTIONS = 64
ARENAS = 2
"""With glibc's default, 8 per core, memory rose for thousands of requests, each of which has a thread; with 2 it stays level."""


class Server(ThreadingHTTPServer):
    """One server with its visits."""

    daemon_threads = True
    request_queue_size = 64

    def __init__(self, address: tuple[str, int], visits: Visits, token: str | None, limits: Limits) -> None:
        self.visits = visits
        self.token = token
        self.limits = limits
        self.files = {f"/{path.name}": path.read_bytes() for path in ASSETS.iterdir() if path.suffix in TYPES}
        self.slots = threading.BoundedSemaphore(MOST_CONNECTIONS)
        self.address_family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
        super().__init__(address, Handler)

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self.server_address[1])

    @property
    def local(self) -> bool:
        """Whether this machine alone reaches it."""
        return is_loopback(str(self.server_address[0]))

    def process_request(self, request: Any, client_address: Any) -> None:
        """In a thread of its own, up to MOST_CONNECTIONS at once."""
        if not self.slots.acquire(timeout=1):
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except BaseException:
            self.slots.release()
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """One connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.slots.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away is no error."""
        if not isinstance(sys.exc_info()[1], OSError):
            traceback.print_exc()

    def service_actions(self) -> None:
        """Now and then, while it waits."""
        self.visits.sweep()


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address."""
    return host in LOOPBACK or host.startswith("127.")


def share_arenas() -> None:
    """Let all threads of this process take memory from ARENAS arenas: what one request frees, the next one uses. glibc only."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).mallopt(-8, ARENAS)  # M_ARENA_MAX of malloc.h


@contextmanager
def open_server(host: str, port: int, token: str | None, limits: Limits) -> Iterator[Server]:
    """A server that listens; `serve_forever` answers. At the end it forgets all visits. InputError: the address cannot be had."""
    if not is_loopback(host) and not token:
        raise InputError(f"`host` is {host}: a token is expected where other machines can reach the page; give `token`")
    if not 0 <= port <= 65535:
        raise InputError(f"`port` is {port}; 0 to 65535 is expected")
    share_arenas()
    with warnings_by_thread(), open_visits(limits.visits) as visits:
        try:
            server = Server((host, port), visits, token, limits)
        except OSError as error:
            reason = system_reason(error)
            raise InputError(f"`host` is {host}, `port` is {port}: {reason}; give another host or port") from error
        try:
            yield server
        finally:
            server.server_close()
