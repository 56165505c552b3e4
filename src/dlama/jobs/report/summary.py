"""The rows of a manifest in; throughput over time, failures in groups, and which results are shown, out. Any number of rows."""

from __future__ import annotations

import heapq
import random
import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from dlama.jobs.results.result import JobResult, Totals

SHOWN = 12
"""Pictures of one contact sheet."""
EXAMPLES = 3
"""Jobs that are named of each group of failures."""
BARS = 48
"""Bars of the throughput, at most."""
SECONDS = (1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 28800, 86400, 604800)
"""Widths that a bar may have."""
PLACE = re.compile(r"(?:\w+://|[A-Za-z]:)?[^\s:;,']*[/\\][^\s:;,']*")
NUMBER = re.compile(r"\d+(?:\.\d+)?")


Ranked = tuple[float, str, JobResult]
"""A result, and by what it is ranked: a value, then its id."""


@dataclass
class Group:
    """Failures that say the same, but for names and numbers."""

    kind: str
    message: str
    """Names of files as FILE, numbers as N."""
    count: int = 0
    examples: list[JobResult] = field(default_factory=list)


@dataclass
class Summary(Totals):
    """What the page shows."""

    groups: dict[tuple[str, str], Group] = field(default_factory=dict)
    """(kind, message without names) -> the failures that say it."""
    hosts: dict[str, int] = field(default_factory=dict)
    """Name -> results that ended there, failed ones too."""
    finished: dict[int, int] = field(default_factory=dict)
    """Second -> results that ended in it."""
    at_random: list[JobResult] = field(default_factory=list)
    """SHOWN results, each as likely as any other."""
    holes: list[Ranked] = field(default_factory=list)
    """A heap of (share, id, result): the SHOWN largest holes."""
    moves: list[Ranked] = field(default_factory=list)
    """A heap of (pixels, id, result): the SHOWN with most filled pixels that were moved behind what was measured."""

    def groups_by_size(self) -> list[Group]:
        """The largest first."""
        return sorted(self.groups.values(), key=lambda one: (-one.count, one.kind, one.message))

    @property
    def largest_holes(self) -> list[JobResult]:
        """The results with the largest holes, the largest first."""
        return _worst_first(self.holes)

    @property
    def most_moves(self) -> list[JobResult]:
        """The results with the most moves of the visibility law, the most first."""
        return _worst_first(self.moves)


def summarise(rows: Iterable[JobResult], seed: int = 0) -> Summary:
    """One pass over the rows; the random ones are drawn by reservoir, so that each result is as likely as any other."""
    found, draw = Summary(), random.Random(seed)
    for row in rows:
        found.add(row)
        second = int(row.finished)
        found.finished[second] = found.finished.get(second, 0) + 1
        if row.host:
            found.hosts[row.host] = found.hosts.get(row.host, 0) + 1
        if row.status == "failed":
            _add_failure(found, row)
            continue
        if len(found.at_random) < SHOWN:
            found.at_random.append(row)
        elif (place := draw.randrange(found.done)) < SHOWN:
            found.at_random[place] = row
        for kept, value in ((found.holes, row.hole_share), (found.moves, row.law_moves)):
            heapq.heappush(kept, (value or 0.0, row.id, row))
            if len(kept) > SHOWN:
                heapq.heappop(kept)
    return found


def _worst_first(kept: list[Ranked]) -> list[JobResult]:
    return [row for value, _, row in sorted(kept, key=lambda one: one[:2], reverse=True) if value > 0]


def without_names(message: str) -> str:
    """A message with FILE for names of files and N for numbers, so that messages of one cause are equal."""
    return NUMBER.sub("N", PLACE.sub("FILE", message))


def throughput(finished: dict[int, int]) -> tuple[int, list[tuple[int, int]]]:
    """Width of a bar in seconds, and (its first second, results that ended in it), idle times between them too, BARS at most."""
    if not finished:
        return SECONDS[0], []
    first, last = min(finished), max(finished)
    width = next((one for one in SECONDS if (last - first) / one < BARS), (last - first) // BARS + 1)
    start = first - first % width
    counts = dict.fromkeys(range(start, last + 1, width), 0)
    for second, count in finished.items():
        counts[start + (second - start) // width * width] += count
    return width, list(counts.items())


def _add_failure(found: Summary, row: JobResult) -> None:
    key = row.error_kind, without_names(row.error)
    group = found.groups.setdefault(key, Group(*key))
    group.count += 1
    if len(group.examples) < EXAMPLES:
        group.examples.append(row)
