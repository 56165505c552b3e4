"""Visitors of the page in; what each of them handed in and got, apart from all others and forgotten when they leave, out."""

from __future__ import annotations

import secrets
import shutil
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import dlama
from dlama.files.results.photo3d import MOST_TRIANGLES
from dlama.geometry.layers.layered_mesh import MeshPart, mesh_layers
from dlama.geometry.rgbd import BoolArray
from dlama.web.answers import PageError
from dlama.web.completions.runs import Run
from dlama.web.form import CompletionRequest
from dlama.web.inputs import Source, Upload, names_of
from dlama.web.marks import Marks
from dlama.writing.drafts import DRAFT, hold, name_of, remove_abandoned

IDLE_SECONDS = 600.0
"""A visit that sends nothing for so long is forgotten (the page sends a sign of life every minute)."""
LEAVING_SECONDS = 20.0
"""So long after its page was closed; a page that is loaded again is back before."""


@dataclass(frozen=True, eq=False)
class Result:
    """A completion, and what it was made of."""

    done: dlama.Completion
    source: Source
    request: CompletionRequest
    marks: Marks | None
    """What was to go; None: nothing."""
    mask: BoolArray | None
    object_mask: dict[str, Any]
    """How the mask was found, as meta.json says it; empty where it was painted, or nothing is removed."""
    warnings: tuple[str, ...]

    @cached_property
    def photo(self) -> tuple[dlama.Photo3D, list[MeshPart]]:
        """Its 3-D photo and the mesh of that; completed when it is first asked for."""
        how = {name: value for name, value in self.request.method.items() if name in ("filler", "model", "seed")}
        photo = dlama.photo3d(self.done.scene, **how)
        return photo, mesh_layers(photo.scene, photo.box, MOST_TRIANGLES)


@dataclass(eq=False)
class Visit:
    """One open page."""

    id: str
    folder: Path
    """Its uploads, as long as it lasts."""
    files: dict[str, Upload] = field(default_factory=dict)
    fields: dict[str, Any] = field(default_factory=dict)
    source: Source | None = None
    warnings: list[str] = field(default_factory=list)
    """What was warned of when it was read."""
    marks: Marks = field(default_factory=Marks)
    listed: list[Any] = field(default_factory=list)
    """The marks as the page sent them, for a page that is loaded again."""
    marked: dict[str, Any] | None = None
    """What was answered to them."""
    found: tuple[Any, dlama.ObjectMask | None] | None = None
    """The clicks and box last looked for, and what they mean."""
    session: dlama.MaskSession | None = None
    """What is kept of the picture for further clicks."""
    mask: BoolArray | None = None
    preview: dict[str, Any] = field(default_factory=dict)
    """The small picture and its marks, made once."""
    run: Run | None = None
    result: Result | None = None
    seen: float = field(default_factory=time.monotonic)
    leaving: bool = False
    closed: bool = False
    lock: threading.RLock = field(default_factory=threading.RLock)

    def names(self) -> dict[Path, str]:
        """Our path of each upload -> the visitor's name of it."""
        return names_of(self.files)

    def require_source(self) -> Source:
        """What was read. PageError."""
        if self.source is None:
            raise PageError("a picture is expected first", "picture")
        return self.source

    def require_result(self) -> Result:
        """What was completed. PageError."""
        if self.result is None:
            raise PageError("nothing has been completed yet")
        return self.result

    def forget_source(self) -> None:
        """Everything that came of the uploads."""
        self.stop()
        self.source = self.mask = self.found = self.session = self.result = self.run = None
        self.marks, self.listed, self.marked, self.preview = Marks(), [], None, {}

    def stop(self) -> None:
        """Cancel what is under way."""
        if self.run is not None:
            self.run.cancel()


class Visits:
    """All open pages; uploads lie in one folder, private to this user, that is removed at the end."""

    def __init__(self, root: Path, most: int) -> None:
        self.root = root
        self.most = most
        self._open: dict[str, Visit] = {}
        self._lock = threading.Lock()

    def begin(self) -> Visit:
        """A new visit. PageError where there are too many."""
        self.sweep()
        with self._lock:
            if len(self._open) >= self.most:
                raise PageError(
                    f"{self.most} pages are open, and no more are taken; close one, or try again in a few minutes",
                    status=503,
                )
            number = secrets.token_urlsafe(24)
            folder = self.root / secrets.token_hex(8)
            folder.mkdir(mode=0o700)
            self._open[number] = Visit(number, folder)
            return self._open[number]

    def find(self, number: str) -> Visit:
        """The visit of that number. PageError where there is none (any more)."""
        with self._lock:
            visit = self._open.get(number)
        if visit is None:
            raise PageError("this page was away for too long and its pictures are gone; start again", status=410)
        visit.seen, visit.leaving = time.monotonic(), False
        return visit

    def leave(self, number: str) -> None:
        """The page was closed, or is being loaded again: forget it soon."""
        with self._lock:
            visit = self._open.get(number)
            if visit is not None:
                visit.leaving, visit.seen = True, time.monotonic()

    def end(self, number: str) -> None:
        """Forget a visit now."""
        with self._lock:
            visit = self._open.pop(number, None)
        if visit is None:
            return
        visit.closed = True
        visit.stop()
        with visit.lock:
            visit.forget_source()
            visit.files.clear()
            shutil.rmtree(visit.folder, ignore_errors=True)

    def sweep(self) -> None:
        """Forget those who left, and those that were silent for long."""
        now = time.monotonic()
        with self._lock:
            visits = list(self._open.values())
        for visit in visits:
            working = visit.run is not None and visit.run.active
            limit = LEAVING_SECONDS if visit.leaving else IDLE_SECONDS
            if now - visit.seen > limit and (visit.leaving or not working) and visit.lock.acquire(blocking=False):
                try:  # one that is being answered is left for the next time
                    self.end(visit.id)
                finally:
                    visit.lock.release()

    def __len__(self) -> int:
        return len(self._open)

    def end_all(self) -> None:
        """Forget everybody."""
        for number in list(self._open):
            self.end(number)


@contextmanager
def open_visits(most: int) -> Iterator[Visits]:
    """Visits, and the folder of their uploads; nothing of it is left afterwards. What a killed server left is removed."""
    system = Path(tempfile.gettempdir())
    remove_abandoned(system, again=True)
    root = system / name_of(DRAFT, "serve")
    root.mkdir(mode=0o700)
    with ExitStack() as stack:
        stack.callback(shutil.rmtree, root, ignore_errors=True)
        stack.enter_context(hold(root))
        visits = Visits(root, most)
        stack.callback(visits.end_all)
        yield visits
