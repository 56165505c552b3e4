"""The page's server, or a batch, in; hours of work pressed into minutes, with all that goes wrong on the way, and figures out.

    python benchmarks/soak.py page [--visitors 4] [--actions 500]
    python benchmarks/soak.py batch [--jobs 2000] [--every 10]

page    Visitors at once, each with pictures of its own colour: uploads, some cut in the middle, reading, marking, previews,
        completions, cancelled ones, files taken home, leaving. No answer but those that are said in words, no picture of
        another visitor, memory after each fifth of the actions.
batch   Jobs on two processes, one of which is killed every few seconds. Every job has its row, none twice, none half-written.
"""

from __future__ import annotations

import argparse
import csv
import http.client
import io
import json
import os
import random
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import dlama
from dlama.web.answers import Limits
from dlama.web.server import Server, open_server

SIDE = 48
"""Pixels of a visitor's pictures."""
BLENDED = 10
"""Levels by which what is filled may differ from the picture's red; those of two visitors lie 50 apart."""
STEPS = 5
"""Times that memory is printed."""


def picture(level: int, noise: int) -> tuple[bytes, bytes]:
    """A picture whose red is `level` wherever it shows anything, and its depth: a box before a wall, as PNG."""
    rng = np.random.default_rng(noise)
    color = rng.integers(0, 256, (SIDE, SIDE, 3), dtype=np.uint8)
    color[..., 0] = level
    depth = np.full((SIDE, SIDE), 4000, np.uint16)
    depth[18:34, 18:34] = 2000
    streams = io.BytesIO(), io.BytesIO()
    for stream, values in zip(streams, (color, depth)):
        Image.fromarray(values).save(stream, "PNG")
    return streams[0].getvalue(), streams[1].getvalue()


class Visitor(threading.Thread):
    """One open page that does what comes to its mind."""

    def __init__(self, server: Server, number: int, actions: int) -> None:
        super().__init__(daemon=True)
        self.server, self.actions, self.number = server, actions, number
        self.rng, self.level = random.Random(number), 40 + 50 * number
        self.done, self.answers, self.faults = 0, Counter[str](), list[str]()
        self.visit = ""

    def run(self) -> None:
        """All actions; what breaks a law is noted."""
        while self.done < self.actions:
            name = self.rng.choices(list(ACTS), [weight for weight, _ in ACTS.values()])[0]
            try:
                ACTS[name][1](self)
            except (OSError, http.client.HTTPException) as error:
                self.faults.append(f"{name}: {type(error).__name__}: {error}")
            self.done += 1

    def ask(
        self, action: str, data: bytes | dict[str, Any] = b"{}", cut: bool = False, **headers: str
    ) -> tuple[int, bytes]:
        """Status and body; cut: the connection ends half way through what is sent."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=600)
        body = json.dumps(data).encode() if isinstance(data, dict) else data
        told = {"X-Dlama-Visit": self.visit, **{name.replace("_", "-"): value for name, value in headers.items()}}
        if cut:
            connection.putrequest("POST", f"/api/{action}")
            for name, value in {**told, "Content-Length": str(len(body))}.items():
                connection.putheader(name, value)
            connection.endheaders(body[: len(body) // 2])
            connection.close()
            return 0, b""
        connection.request("POST", f"/api/{action}", body, told)
        answer = connection.getresponse()
        status, found = answer.status, answer.read()
        connection.close()
        self.answers[f"{action.partition('?')[0]} {status}"] += 1
        if status >= 500 and status != 503:
            self.faults.append(f"{action}: {status} {found[:200]!r}")
        elif status >= 400 and not json.loads(found).get("error"):
            self.faults.append(f"{action}: {status} without a word")
        return status, found

    def begin(self) -> None:
        """A new page, with an upload or two."""
        old = self.visit
        status, found = self.ask("visit")
        if status == 200:  # else as many are open as may be; those that left are forgotten after a while
            self.visit = json.loads(found)["visit"]
            self.ask("leave", old.encode())
        self.upload()

    def upload(self, cut: bool = False) -> None:
        """Picture and depth, and reading them."""
        for role, data in zip(("picture", "depth"), picture(self.level, self.rng.randrange(10))):
            self.ask(f"upload?role={role}", data, cut=cut, X_Name=f"{role}.png")
        self.ask("read", {"fov": "60"})

    def own(self, found: bytes) -> None:
        """Every pixel that shows anything shows this visitor's red."""
        red = np.array(Image.open(io.BytesIO(found)).convert("RGB"))[..., 0].astype(int)
        if np.abs(red[red > 0] - self.level).max(initial=0) > BLENDED:
            self.faults.append(f"a picture of another visitor: red {np.unique(red)[:8]} and not {self.level}")

    def look(self) -> None:
        """The source, and a preview."""
        status, found = self.ask("source", {})
        if status == 200:
            self.own(found)
        self.ask("preview", {"yaw": self.rng.randrange(-30, 30)})

    def complete(self, cancelled: bool = False) -> None:
        """A completion, or the beginning of one."""
        marks = [{"kind": "click", "at": [26, 26]}] if self.rng.random() < 0.5 else []
        self.ask("mark", {"marks": marks})
        if self.ask("complete", {"yaw": self.rng.randrange(-20, 20), "filler": "telea"})[0] != 200:
            return
        if cancelled:
            self.ask("cancel")
            return
        while True:
            status, found = self.ask("run")
            if status != 200 or json.loads(found)["state"] not in ("waiting", "running"):
                break
            time.sleep(0.02)
        status, found = self.ask("picture", {"kind": "image"})
        if status == 200:
            self.own(found)

    def nonsense(self) -> None:
        """What no page sends."""
        action = self.rng.choice(["read", "mark", "complete", "pixel", "file", "zip", "nothing"])
        self.ask(action, self.rng.choice([{"yaw": "x"}, {"marks": 3}, b"[", b"{}", {"name": "../../etc/passwd"}]))


ACTS: dict[str, tuple[int, Any]] = {
    "begin": (2, Visitor.begin),
    "upload": (6, Visitor.upload),
    "cut upload": (4, lambda one: one.upload(cut=True)),
    "look": (8, Visitor.look),
    "complete": (4, Visitor.complete),
    "cancelled": (3, lambda one: one.complete(cancelled=True)),
    "zip": (1, lambda one: one.ask("zip", {})),
    "nonsense": (4, Visitor.nonsense),
}
"""What a visitor does: how often, and how."""


def resident_mb() -> float:
    """Memory of this process, MB."""
    return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def soak_page(visitors: int, actions: int) -> int:
    """How many laws were broken."""
    with open_server("127.0.0.1", 0, None, Limits()) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        everybody = [Visitor(server, number, actions) for number in range(visitors)]
        started, marks = time.monotonic(), [actions * visitors * step // STEPS for step in range(1, STEPS + 1)]
        for one in everybody:
            one.begin()
            one.start()
        while marks:
            done = sum(one.done for one in everybody)
            if done >= marks[0]:
                print(f"{done:6d} actions, {time.monotonic() - started:5.0f} s, {resident_mb():6.0f} MB", flush=True)
                marks.pop(0)
            time.sleep(0.2)
        for one in everybody:
            one.ask("leave", one.visit.encode())
        server.visits.end_all()
        left = [path for path in server.visits.root.rglob("*") if path.is_file()]
        server.shutdown()
    answers: Counter[str] = sum((one.answers for one in everybody), Counter())
    faults = [fault for one in everybody for fault in one.faults] + [f"left behind: {path}" for path in left]
    print(", ".join(f"{name}: {count}" for name, count in sorted(answers.items())))
    print("\n".join(faults[:20]))
    print(f"{sum(answers.values())} requests of {visitors} visitors, {len(faults)} laws broken")
    return len(faults)


def soak_batch(jobs: int, every: float) -> int:
    """How many laws were broken."""
    with tempfile.TemporaryDirectory(prefix="dlama-soak-") as name:
        folder, killed = Path(name), 0
        color, depth = picture(200, 0)
        (folder / "image.png").write_bytes(color)
        (folder / "depth.png").write_bytes(depth)
        inputs = {"verb": "view", "image": str(folder / "image.png"), "depth": str(folder / "depth.png")}
        rows = [{"id": f"{n:05d}", "yaw": 1 + n % 20, **inputs} for n in range(jobs)]
        over, started, out = threading.Event(), time.monotonic(), folder / "out"

        def kill() -> None:
            nonlocal killed
            while not over.wait(every):
                mine = [int(one) for one in children(os.getpid()) if b"spawn_main" in command_of(one)]
                if mine:
                    os.kill(random.choice(mine), signal.SIGKILL)
                    killed += 1

        threading.Thread(target=kill, daemon=True).start()
        found = list(dlama.batch(rows, out, workers=2, threads=1, fov=60, filler="telea", only="image"))
        over.set()
        ids = Counter(row.id for row in found)
        failed = [row for row in found if row.status == "failed"]
        with (out / "manifest.csv").open(encoding="utf-8", newline="") as stream:
            listed = Counter(row["id"] for row in csv.DictReader(stream))
        broken = [row.id for row in found if row.status == "done" and not whole(out / row.folder)]
        drafts = [str(path) for path in out.rglob(".dlama-*")]
        wrong = (
            sum(count != 1 for count in ids.values())
            + abs(jobs - len(ids))
            + (listed != ids)
            + len(broken)
            + len(drafts)
        )
        died = Counter(row.error_kind for row in failed)
        print(
            f"{jobs} jobs in {time.monotonic() - started:.0f} s, {killed} workers killed: {len(ids)} rows, {len(failed)} failed "
            f"({dict(died)}), {len(broken)} half-written, {len(drafts)} drafts left, {resident_mb():.0f} MB; {wrong} laws broken"
        )
        return wrong


def whole(folder: Path) -> bool:
    """Whether a result has its picture and its meta.json, both readable."""
    try:
        json.loads((folder / "meta.json").read_text("utf-8"))
        with Image.open(folder / "image.png") as opened:
            opened.load()
    except (OSError, ValueError, SyntaxError):
        return False
    return True


def children(pid: int) -> list[str]:
    """Process ids of the children of a process, of all its threads."""
    return [one for task in Path(f"/proc/{pid}/task").iterdir() for one in (task / "children").read_text().split()]


def command_of(pid: str) -> bytes:
    """Its command line; nothing where it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def main() -> int:
    """How many laws were broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("page", "batch"))
    parser.add_argument("--visitors", type=int, default=4)
    parser.add_argument("--actions", type=int, default=500)
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--every", type=float, default=10.0, help="seconds between two kills")
    given = parser.parse_args()
    if given.what == "page":
        return soak_page(given.visitors, given.actions)
    return soak_batch(given.jobs, given.every)


if __name__ == "__main__":
    sys.exit(main())
