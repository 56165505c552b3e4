"""A server of the page that answers while a test runs."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from dlama.web.answers import Limits
from dlama.web.server import Server, open_server


@contextmanager
def answering(limits: Limits) -> Iterator[Server]:
    """A server on a free port, in a thread of its own."""
    with open_server("127.0.0.1", 0, None, limits) as opened:
        thread = threading.Thread(target=opened.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield opened
        opened.shutdown()
        thread.join()
