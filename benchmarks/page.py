"""The page's server in; what a visitor waits for, and its memory over many completions, printed.

    python benchmarks/page.py [--completions 50]

Each figure is the median of its repetitions, over HTTP on this machine, without a browser.
"""

from __future__ import annotations

import argparse
import http.client
import json
import statistics
import threading
import time
from pathlib import Path
from typing import Any

from dlama.web.answers import Limits
from dlama.web.server import Server, open_server


class Page:
    """An open page."""

    def __init__(self, server: Server) -> None:
        self.connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=600)
        self.visit = ""
        self.visit = json.loads(self.post("visit"))["visit"]

    def post(self, action: str, **fields: Any) -> bytes:
        """What an action answers."""
        self.connection.request("POST", f"/api/{action}", json.dumps(fields), {"X-Dlama-Visit": self.visit})
        answer = self.connection.getresponse()
        data = answer.read()
        assert answer.status == 200, data
        return data

    def complete(self, **request: Any) -> None:
        """Complete, and wait."""
        self.post("complete", **request)
        while json.loads(self.post("run"))["state"] in ("waiting", "running"):
            time.sleep(0.02)


def resident_mb() -> float:
    """Memory of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 2**20


def timed(name: str, times: int, ask: Any) -> None:
    """Median and slowest of some repetitions, after one that warms up."""
    ask(0)
    took = []
    for number in range(times):
        wall = time.perf_counter()
        ask(number + 1)
        took.append(1000 * (time.perf_counter() - wall))
    print(f"{name:<42} {statistics.median(took):8.0f} ms   slowest {max(took):6.0f} ms")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--completions", type=int, default=50)
    completions = parser.parse_args().completions
    with open_server("127.0.0.1", 0, None, Limits()) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = Page(server)
        timed("open the example street (512 x 512)", 3, lambda _: page.post("example", name="street"))
        marks = [{"kind": "click", "at": [260, 350]}]
        timed("mask of a click", 5, lambda n: page.post("mark", marks=[{"kind": "click", "at": [255 + n, 350]}]))
        timed("the same, one stroke more", 5, lambda n: page.post("mark", marks=[*marks, stroke(n)]))
        timed(
            "preview at 256 px, object marked", 60, lambda n: page.post("preview", yaw=(n * 7) % 60 - 30, pitch=n % 9)
        )
        timed("complete, without the object", 3, lambda n: page.complete(yaw=10 + n))
        timed("scene in 3-D", 3, lambda _: page.post("scene"))
        timed("everything as zip", 3, lambda _: page.post("zip"))
        start = resident_mb()
        for number in range(completions):
            page.complete(yaw=number % 30)
            if (number + 1) % 10 == 0:
                print(
                    f"memory after {number + 1:3d} more completions {resident_mb():8.0f} MB   (before them {start:.0f} MB)"
                )
        server.shutdown()


def stroke(number: int) -> dict[str, Any]:
    """A line of the brush."""
    return {"kind": "add", "points": [[200 + number, 300], [320, 300 + number]], "radius": 12}


main()
