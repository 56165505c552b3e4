"""Files handed in to a visit as a browser does, and a completion waited for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dlama.web import api
from dlama.web.answers import Limits
from dlama.web.completions import results
from dlama.web.visits import Result, Visit

LIMITS = Limits()


def hand_in(visit: Visit, role: str, path: Path, name: str | None = None) -> dict[str, Any]:
    """One file."""
    return api.keep_upload(visit, role, name or path.name, LIMITS, lambda file: file.write(path.read_bytes()))


def open_frame(visit: Visit, frame: Path, **fields: Any) -> dict[str, Any]:
    """The small frame's picture and depth, read."""
    hand_in(visit, "picture", frame / "image.png")
    hand_in(visit, "depth", frame / "depth.png")
    return api.read(visit, {"fov": "60", **fields})


def completed(visit: Visit, **fields: Any) -> Result:
    """A completion begun and waited for."""
    results.complete(visit, {"filler": "telea", **fields})
    assert visit.run is not None
    visit.run.join()
    reported = results.run(visit, {})
    assert reported["state"] == "done" and visit.result is not None
    return visit.result
