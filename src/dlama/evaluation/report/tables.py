"""A Summary in; tables, some of the paper's shape, out, as cells that markdown and HTML are written from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

from dlama.evaluation.protocols.methods import NO_FILL
from dlama.evaluation.report.columns import PAPER, Which, better_direction, column_title, format_value, paper_value
from dlama.evaluation.report.summary import ALL, Place
from dlama.evaluation.runner.store import Row


class Cell(NamedTuple):
    """One field of a table."""

    text: str
    value: float | None = None
    """What it sorts by; None: its text."""
    best: bool = False
    interval: str = ""
    other: bool = False
    """A number of other data."""


@dataclass(frozen=True)
class Table:
    """A table with its heading."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    minor: bool = False
    """Folded away at first."""

    @property
    def word_columns(self) -> list[bool]:
        """True for each column that has words only, no numbers."""
        return [all(row[number].value is None for row in self.rows) for number in range(len(self.head))]


EMPTY = Cell("–")


def by_yaw(
    place: Place, chosen: Sequence[Which], methods: Sequence[str], yaws: Sequence[str], title: str
) -> Table | None:
    """A row a yaw and method, a column a metric, and the paper's own row where it has one; best of each yaw bold."""
    rows: list[tuple[Cell, ...]] = []
    for yaw in yaws:
        cells = [_mark_best([_cell(place, yaw, one, which) for one in methods], which[2], methods) for which in chosen]
        rows += [(Cell(yaw), Cell(method), *own) for method, *own in zip(methods, *cells)]
        published = [_published_cell(yaw, which) for which in chosen]
        if any(cell is not EMPTY for cell in published):
            rows.append((Cell(yaw, other=True), Cell(PAPER, other=True), *published))
    head = ("yaw", "method", *(column_title(*which) for which in chosen))
    return Table(title, head, tuple(rows)) if rows else None


def _published_cell(yaw: str, which: Which) -> Cell:
    value = paper_value(yaw, *which)
    return EMPTY if value is None else Cell(format_value(value, which[2]), value, other=True)


def side_by_side(place: Place, chosen: Iterable[Which], methods: Sequence[str], title: str) -> Table | None:
    """Many metrics over all frames: a row a region and metric, a column a method; best bold."""
    rows = []
    for which in chosen:
        cells = _mark_best([_cell(place, ALL, one, which) for one in methods], which[2], methods)
        if any(cell != EMPTY for cell in cells):
            rows.append((Cell(which[0]), Cell(column_title(*which)), *cells))
    return Table(title, ("region", "metric", *methods), tuple(rows)) if rows else None


def variants(place: Place, chosen: Sequence[Which], title: str) -> Table | None:
    """Runs that differ from the methods as named, next to these: a row a method and variant, a column a metric."""
    ran = {name: variant_of(name) for name in place.summary.methods if place.of(method=name)}
    named = [name for name, (_, variant) in ran.items() if not variant]
    if len(named) == len(ran):
        return None
    seen = [which for which in chosen if any(place.mean(ALL, name, which) for name in ran)]
    rows = [
        (Cell(method), Cell(variant or "as named"), *(_cell(place, ALL, name, which) for which in seen))
        for base in named
        for name, (method, variant) in ran.items()
        if method == base
    ]
    head = ("method", "variant", *(f"{which[0]} {column_title(*which)}" for which in seen))
    return Table(title, head, tuple(rows))


def runtimes(timings: Sequence[Row], methods: Sequence[str]) -> Table | None:
    """Median and longest seconds a frame, and the largest memory: a row a protocol and method."""
    rows = []
    for protocol in dict.fromkeys(row.protocol for row in timings):
        for method in methods:
            own = [row for row in timings if (row.protocol, row.method) == (protocol, method)]
            if any(row.metric == "seconds" for row in own):
                rows.append((Cell(protocol), Cell(method), *_runtime_cells(own)))
    head = ("protocol", "method", "seconds, median", "seconds, longest", "with scoring, median", "peak MiB")
    return Table("Runtime and memory per frame", head, tuple(rows)) if rows else None


def _runtime_cells(timings: Sequence[Row]) -> list[Cell]:
    """Of one protocol and method."""
    took, scored, peak = (
        [row.value for row in timings if row.metric == metric] for metric in ("seconds", "seconds_scored", "peak_mib")
    )
    seconds = [Cell(f"{one:.2f}", one) for one in (median(took), max(took), median(scored or took))]
    most = max(peak, default=math.nan)
    return [*seconds, Cell(f"{most:.0f}", most)]


def variant_of(method: str) -> tuple[str, str]:
    """(`dlama/telea`, `mask+3`) of `dlama+mask+3/telea`."""
    recipe, _, filler = method.rpartition("/")
    base, _, variant = recipe.partition("+")
    return f"{base}/{filler}", variant


def _cell(place: Place, yaw: str, method: str, which: Which) -> Cell:
    one, metric = place.mean(yaw, method, which), which[2]
    if one is None:
        return EMPTY
    ends = [format_value(end, metric) for end in (one.low, one.high) if end is not None]
    return Cell(format_value(one.value, metric), one.value, interval=" to ".join(ends))


def _mark_best(cells: list[Cell], metric: str, methods: Sequence[str]) -> list[Cell]:
    """The cells of one metric with the best marked, and all that read the same; none where no side is good or all are alike.

    The baseline that fills nothing is never marked: its depth is measured only where it has any.
    """
    fills = [not one.endswith(f"/{NO_FILL}") for one in methods]
    known = [cell for cell, does in zip(cells, fills) if does and cell.value is not None]
    side = better_direction(metric)
    if side == 0 or len({cell.text for cell in known}) < 2:
        return cells
    best = max(known, key=lambda cell: side * (cell.value or 0.0)).text
    return [cell._replace(best=does and cell.text == best) for cell, does in zip(cells, fills)]
