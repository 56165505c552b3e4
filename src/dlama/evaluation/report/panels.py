"""Stored results in; the panels that the report shows (best, median and worst of each yaw and method) out."""

from __future__ import annotations

import base64
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from dlama.evaluation.report.columns import Which
from dlama.evaluation.report.summary import ALL, yaw_labels
from dlama.evaluation.runner.store import Stored

RANKED_BY: tuple[Which, ...] = tuple(
    (region, "rgb", metric) for metric in ("lpips", "mse") for region in ("unseen", "mask", "whole")
)
"""The first that was measured decides which frames are best and worst; less is better."""
BUDGET = 18_000_000
"""Characters of all panels in the page; those beyond it are left out."""


class Chosen(NamedTuple):
    """One panel of the report."""

    protocol: str
    yaw: str
    method: str
    rank: str
    """best, median or worst."""
    scene: str
    frame: str
    ranked_by: str
    score: float
    file: str


def choose(stored: Sequence[Stored]) -> list[Chosen]:
    """Best, median and worst frame of every protocol, yaw (± together) and method that has panels."""
    labels = yaw_labels(row for one in stored for row in one.rows)
    groups: dict[tuple[str, str, str], list[Chosen]] = defaultdict(list)
    for panel in (panel for one in stored for panel in panels_of(one, labels)):
        groups[panel.protocol, panel.yaw, panel.method].append(panel)
    return [panel for group in groups.values() for panel in _rank(group)]


def panels_of(one: Stored, labels: Mapping[tuple[str, str, float | None], Sequence[str]]) -> Iterator[Chosen]:
    """The panels of one frame that can be ranked; labels: `yaw_labels`."""
    for recipe, file in one.panels.items():
        own = [row for row in one.rows if row.recipe == recipe]
        values = {row[7:10]: row.value for row in own}
        which = next((one for one in RANKED_BY if values.get(one, math.nan) >= 0), None)
        if which is not None:
            row = own[0]
            yaws = labels[row.protocol, row.dataset, row.yaw]
            yaw, by = yaws[1] if len(yaws) > 1 else ALL, f"{which[0]} {which[2]}"
            yield Chosen(row.protocol, yaw, row.method, "", row.scene, row.frame, by, values[which], file)


def as_data_urls(folder: Path, chosen: Sequence[Chosen]) -> list[tuple[Chosen, str]]:
    """Each with its strip as a data: URL, as many as fit BUDGET.

    Args:
        folder: where the panels' files lie; those that are missing are skipped.
    """
    found, used = [], 0
    for one in chosen:
        path = folder / one.file
        if path.is_file():
            url = f"data:image/jpeg;base64,{base64.b64encode(path.read_bytes()).decode()}"
            used += len(url)
            found += [(one, url)] if used <= BUDGET else []
    return found


def _rank(group: list[Chosen]) -> list[Chosen]:
    """Of equal scores the first in the data set's order, so that every run chooses the same."""
    ordered = sorted(group, key=lambda one: one.score)
    places = {"best": 0, "median": (len(ordered) - 1) // 2, "worst": len(ordered) - 1}
    if len(ordered) < 3:
        places = {"best": 0, "worst": 1} if len(ordered) == 2 else {"median": 0}
    return [ordered[place]._replace(rank=rank) for rank, place in places.items()]
