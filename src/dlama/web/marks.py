"""What a visitor marked on the picture (clicks, a box, brush strokes) in; the mask of what to remove out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

import dlama
from dlama.geometry.holes import grow_or_shrink
from dlama.geometry.rgbd import BoolArray
from dlama.jobs.parameters import number
from dlama.web.answers import PageError

MOST_MARKS, MOST_POINTS, MOST_GROWTH = 200, 20_000, 60
"""Marks, points of all strokes together, and pixels that a mask is grown or shrunk by, at most."""


@dataclass(frozen=True)
class Stroke:
    """A line painted with a round brush."""

    points: tuple[tuple[float, float], ...]
    """x right, y down, pixels."""
    radius: float
    """Pixels."""
    adds: bool
    """Whether it adds to the mask, or takes from it."""


@dataclass(frozen=True)
class Marks:
    """Everything marked, as the page lists it."""

    clicks: tuple[tuple[float, float], ...] = ()
    not_clicks: tuple[tuple[float, float], ...] = ()
    box: tuple[float, float, float, float] | None = None
    strokes: tuple[Stroke, ...] = ()
    with_shadow: bool = False
    candidate: str = "object"
    grow: int = 0
    """Pixels; negative: the mask shrinks."""

    @property
    def points_at(self) -> bool:
        """Whether clicks or a box point at an object."""
        return bool(self.clicks or self.box)

    @property
    def any(self) -> bool:
        """Whether anything is marked."""
        return self.points_at or any(stroke.adds for stroke in self.strokes)

    @property
    def in_words(self) -> bool:
        """Whether clicks and a box alone describe it, as the command line can; strokes and growth need a mask file."""
        return self.points_at and not self.strokes and self.grow == 0


def read_marks(fields: Mapping[str, Any]) -> Marks:
    """The marks that the page sent. InputError."""
    listed = list_marks(fields)
    clicks, not_clicks = (tuple(point(mark.get("at")) for mark in listed[kind]) for kind in ("click", "not"))
    boxes = [numbers(mark.get("box"), 4) for mark in listed["box"]]
    grow = round(number("grow", fields.get("grow") or 0))
    if abs(grow) > MOST_GROWTH:
        raise PageError(f"grow is {grow} px; {-MOST_GROWTH} to {MOST_GROWTH} is expected", "marks")
    reading = str(fields.get("candidate") or "object")[:20]
    shadow = fields.get("with_shadow") is True
    strokes = read_strokes(listed["stroke"])
    return Marks(clicks, not_clicks, boxes[-1] if boxes else None, strokes, shadow, reading, grow)  # type: ignore[arg-type]


def list_marks(fields: Mapping[str, Any]) -> dict[str, list[Mapping[str, Any]]]:
    """Kind -> the marks of it that the page sent, in their order; of strokes those that add and those that erase. PageError."""
    listed = fields.get("marks") or []
    if not isinstance(listed, list) or len(listed) > MOST_MARKS:
        raise PageError(f"marks must be a list of at most {MOST_MARKS}", "marks")
    found: dict[str, list[Mapping[str, Any]]] = {"click": [], "not": [], "box": [], "stroke": []}
    for mark in listed:
        kind = mark.get("kind") if isinstance(mark, dict) else None
        kind = "stroke" if kind in ("add", "erase") else kind
        if kind not in found:
            raise PageError("a mark is a click, not, box, add or erase", "marks")
        found[kind].append(mark)
    return found


def read_strokes(marks: Sequence[Mapping[str, Any]]) -> tuple[Stroke, ...]:
    """Strokes of MOST_POINTS together. InputError."""
    strokes, left = list[Stroke](), MOST_POINTS
    for mark in marks:
        line = mark.get("points")
        if not isinstance(line, list) or not 0 < len(line) <= left:
            raise PageError(f"a stroke must have points, all strokes together at most {MOST_POINTS}", "marks")
        left -= len(line)
        radius = min(max(number("radius", mark.get("radius")), 0.5), 500.0)
        strokes.append(Stroke(tuple(map(point, line)), radius, mark["kind"] == "add"))
    return tuple(strokes)


def point(value: Any) -> tuple[float, float]:
    """x, y. InputError."""
    x, y = numbers(value, 2)
    return x, y


def numbers(value: Any, count: int) -> tuple[float, ...]:
    """So many finite numbers. InputError."""
    if not isinstance(value, list) or len(value) != count:
        raise PageError(f"{count} numbers are expected for a mark", "marks")
    return tuple(round(number("mark", each), 1) for each in value)


def pointing(marks: Marks) -> dict[str, Any]:
    """Keyword arguments of `find_mask`, of those that the page sets."""
    return {name: getattr(marks, name) for name in ("clicks", "not_clicks", "box", "candidate", "with_shadow")}


def find(session: dlama.MaskSession, marks: Marks) -> dlama.ObjectMask | None:
    """The object that clicks or a box mean; None where there are none. InputError."""
    if marks.points_at:
        return session.find(**pointing(marks))
    if marks.not_clicks and not marks.strokes:
        raise PageError("a click next to the object corrects its mask; click on the object first", "marks")
    return None


def mask_of(hw: tuple[int, int], marks: Marks, found: dlama.ObjectMask | None) -> BoolArray:
    """H x W bool, True = remove: what was found, then the strokes in their order, then grown or shrunk."""
    mask = np.zeros(hw, np.uint8) if found is None else found.mask.astype(np.uint8)
    for stroke in marks.strokes:
        paint(mask, stroke)
    return grow_or_shrink(mask > 0, marks.grow)


def paint(mask: np.ndarray, stroke: Stroke) -> None:
    """One stroke into a uint8 mask."""
    corners = np.rint(np.array(stroke.points)).astype(np.int32)
    limit = 4 * max(mask.shape)
    corners = np.clip(corners, -limit, limit)
    value, radius = int(stroke.adds), max(1, round(stroke.radius))
    cv2.polylines(mask, [corners.reshape(-1, 1, 2)], False, value, 2 * radius)
    for x, y in corners[[0, -1]].tolist():
        cv2.circle(mask, (x, y), radius, value, -1)
