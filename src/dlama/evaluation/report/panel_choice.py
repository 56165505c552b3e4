"""Stored results in; which panels the report shows (best, median and worst of each yaw and method) out, made to fit."""

from __future__ import annotations

import base64
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from dlama.evaluation.report.metric_names import Which
from dlama.evaluation.report.summary import ALL, yaw_labels
from dlama.evaluation.runner.results_table import result_rows
from dlama.evaluation.runner.store import Stored, StoredRun

RANKED_BY: tuple[Which, ...] = tuple(
    (region, "rgb", metric) for metric in ("lpips", "mse") for region in ("unseen", "mask", "whole")
)
"""The first that was measured decides which frames are best and worst; less is better."""
BUDGET = 14_000_000
"""Bytes of all panels in the page, as text."""
LADDER = ((1300, 88), (1300, 78), (1000, 75), (800, 70), (640, 62), (500, 55))
"""Width in px and JPEG quality, tried in turn until all fit."""


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
            found = _score(run)
            if run.panel is None or found is None:
                continue
            recipe = f"{one.recipe}+{run.variant}" if run.variant else one.recipe
            own = labels[one.protocol, one.dataset, one.yaw]
            place = (one.protocol, own[1] if len(own) > 1 else ALL, f"{recipe}/{one.filler}")
            which, score = found
            groups[place].append(Chosen(*place, "", one.scene, one.frame, f"{which[0]} {which[2]}", score, run.panel))
    return [panel for group in groups.values() for panel in _ranked(group)]


def as_data_urls(folder: Path, chosen: Sequence[Chosen]) -> list[tuple[Chosen, str]]:
    """Each with its picture as a data: URL, all alike as large as fits BUDGET; panels beyond even that are left out."""
    from dlama.evaluation.report.panels import rescaled_jpeg

    files = [(one, (folder / one.file).read_bytes()) for one in chosen if (folder / one.file).is_file()]
    texts: list[tuple[Chosen, str]] = []
    for width, quality in LADDER:
        texts = [(one, base64.b64encode(rescaled_jpeg(data, width, quality)).decode()) for one, data in files]
        if sum(len(text) for _, text in texts) <= BUDGET:
            break
    kept, used = [], 0
    for one, text in texts:
        used += len(text)
        if used <= BUDGET:
            kept.append((one, f"data:image/jpeg;base64,{text}"))
    return kept


def _score(run: StoredRun) -> tuple[Which, float] | None:
    values = {measure[:3]: measure.value for measure in run.measures}
    return next(((which, values[which]) for which in RANKED_BY if values.get(which, float("nan")) >= 0), None)


def _ranked(group: list[Chosen]) -> list[Chosen]:
    """The first of those with the same score in the data set's order, so that every run chooses alike."""
    ordered = sorted(group, key=lambda one: one.score)
    places = {"best": 0, "median": (len(ordered) - 1) // 2, "worst": len(ordered) - 1}
    if len(ordered) < 3:
        places = {"best": 0, "worst": 1} if len(ordered) == 2 else {"median": 0}
    return [ordered[place]._replace(rank=rank) for rank, place in places.items()]
