"""Stored results in; the panels that the report shows (best, median and worst of each yaw and method) out, made to fit."""

from __future__ import annotations

import base64
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from dlama.errors import FileError
from dlama.evaluation.report.columns import Which
from dlama.evaluation.report.summary import ALL, yaw_labels
from dlama.evaluation.runner.store import Stored, StoredRun, result_rows
from dlama.evaluation.runner.strips import cut_strip, jpeg, shrink
from dlama.files.rasters.pictures import read_color
from dlama.geometry.rgbd import UInt8Array

RANKED_BY: tuple[Which, ...] = tuple(
    (region, "rgb", metric) for metric in ("lpips", "mse") for region in ("unseen", "mask", "whole")
)
"""The first that was measured decides which frames are best and worst; less is better."""
BUDGET = 14_000_000
"""Bytes of all panels in the page, as text."""
LADDER = ((256, 88), (256, 78), (200, 75), (160, 70), (128, 62), (100, 55))
"""Largest side of a picture in px and JPEG quality, tried in turn until all fit."""


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


@dataclass(frozen=True)
class ShownPanel:
    """One panel with its pictures."""

    chosen: Chosen
    urls: tuple[str, ...]
    """data: URLs in the order of `dlama.evaluation.runner.strips.COLUMNS`: the colours, then the depths."""

    @property
    def size(self) -> int:
        """Characters of all URLs."""
        return sum(map(len, self.urls))


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
    return [panel for group in groups.values() for panel in _rank(group)]


def as_data_urls(folder: Path, chosen: Sequence[Chosen]) -> list[ShownPanel]:
    """Each with its pictures as data: URLs, all alike as large as fits BUDGET; panels beyond even that are left out.

    Args:
        folder: where the panels' files lie; those that are missing or damaged are skipped.
    """
    strips = [(one, read_strip(folder / one.file)) for one in chosen]
    whole = [(one, strip) for one, strip in strips if strip is not None]
    found: list[ShownPanel] = []
    for side, quality in LADDER:
        found = [ShownPanel(one, tuple(_urls(strip, side, quality))) for one, strip in whole]
        if sum(one.size for one in found) <= BUDGET:
            break
    kept, used = [], 0
    for one in found:
        used += one.size
        if used <= BUDGET:
            kept.append(one)
    return kept


def read_strip(path: Path) -> UInt8Array | None:
    """The strip of a panel, H x W x 3; None where the file is missing, damaged, or too small to hold all its pictures."""
    try:
        picture = read_color(path)
    except FileError:
        return None
    return picture if all(cell.size for cell in cut_strip(picture)) else None


def _urls(strip: UInt8Array, side: int, quality: int) -> Iterator[str]:
    """The pictures of a strip, each at most so many px a side, as data: URLs."""
    for cell in cut_strip(strip):
        yield f"data:image/jpeg;base64,{base64.b64encode(jpeg(shrink(cell, side), quality)).decode()}"


def _score(run: StoredRun) -> tuple[Which, float] | None:
    values = {measure[:3]: measure.value for measure in run.measures}
    return next(((which, values[which]) for which in RANKED_BY if values.get(which, float("nan")) >= 0), None)


def _rank(group: list[Chosen]) -> list[Chosen]:
    """Of equal scores the first in the data set's order, so that every run chooses the same."""
    ordered = sorted(group, key=lambda one: one.score)
    places = {"best": 0, "median": (len(ordered) - 1) // 2, "worst": len(ordered) - 1}
    if len(ordered) < 3:
        places = {"best": 0, "worst": 1} if len(ordered) == 2 else {"median": 0}
    return [ordered[place]._replace(rank=rank) for rank, place in places.items()]
