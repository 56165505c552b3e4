"""Stored results in; the panels that the report shows (best, median and worst of each yaw and method) out."""

from __future__ import annotations

import base64
import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from dlama.evaluation.report.columns import Which
from dlama.evaluation.report.summary import ALL, yaw_labels
from dlama.evaluation.runner.store import Stored, result_rows
from dlama.evaluation.runner.strips import is_whole_jpeg

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
    labels = yaw_labels(result_rows(stored))
    groups: dict[tuple[str, str, str], list[Chosen]] = defaultdict(list)
    for one in stored:
        for run in one.runs:
            values = {measure[:3]: measure.value for measure in run.measures}
            which = next((one for one in RANKED_BY if values.get(one, math.nan) >= 0), None)
            if run.panel is None or which is None:
                continue
            own = labels[one.protocol, one.dataset, one.yaw]
            place = (one.protocol, own[1] if len(own) > 1 else ALL, f"{one.recipe_of(run)}/{one.filler}")
            by, score = f"{which[0]} {which[2]}", values[which]
            groups[place].append(Chosen(*place, "", one.scene, one.frame, by, score, run.panel))
    return [panel for group in groups.values() for panel in _rank(group)]


def as_data_urls(folder: Path, chosen: Sequence[Chosen]) -> list[tuple[Chosen, str]]:
    """Each with its strip as a data: URL, as many as fit BUDGET.

    Args:
        folder: where the panels' files lie; those that are missing or cut short are skipped.
    """
    found, used = [], 0
    for one in chosen:
        path = folder / one.file
        if is_whole_jpeg(path):
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
