"""Rows of results in; a paired comparison of our recipe with the paper's, same filler and same cases, as a table out."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Collection, Sequence

import numpy as np

from dlama.evaluation.protocols.methods import NO_FILL
from dlama.evaluation.report.columns import PAPER_SHAPE, Which, better_direction, column_title
from dlama.evaluation.report.summary import ALL, interval, yaw_labels, yaw_order
from dlama.evaluation.report.tables import EMPTY, Cell, Table
from dlama.evaluation.runner.store import Row

OURS, THEIRS = "dlama", "paper"
NOTE = (
    f"Change of the mean from {THEIRS} to {OURS} (PSNR in dB) with the same filler on the same cases, with its 95 % interval "
    "over scenes, and on how many of the cases it is better. Bold: better on average."
)
Pairs = dict[str, list[tuple[float, float]]]
"""Scene -> (ours, theirs) of each case."""


def paired_comparison(
    rows: Sequence[Row], protocol: str, dataset: str, chosen: Sequence[Which], seed: int = 0
) -> Table | None:
    """A row a filler and yaw (± together; and all, where there are several), a column a metric.

    Args:
        seed: the intervals' resamples of scenes are drawn with it.
    Returns:
        None where only one of the recipes ran.
    """
    pairs = _pairs(rows, protocol, dataset)
    seen = [which for which in chosen if any(key[2] == which for key in pairs)]
    places = dict.fromkeys((filler, yaw) for filler, yaw, which in pairs if which in seen and filler != NO_FILL)
    lines = [
        (Cell(filler), Cell(yaw), *(_cell(pairs.get((filler, yaw, which)), which[2], seed) for which in seen))
        for filler, yaw in _in_order(places)
    ]
    head = ("filler", "yaw", *(column_title(*which) for which in seen))
    where = "" if tuple(chosen) == PAPER_SHAPE else f", {chosen[0][0]}"
    title = f"{OURS} against {THEIRS}, same filler{where}"
    return Table(title, head, tuple(lines), NOTE) if lines else None


def _pairs(rows: Sequence[Row], protocol: str, dataset: str) -> dict[tuple[str, str, Which], Pairs]:
    rows = [row for row in rows if (row.protocol, row.dataset) == (protocol, dataset)]
    labels = yaw_labels(rows)
    theirs = {(*row[2:4], *row[6:10]): row.value for row in rows if row.recipe == THEIRS}
    found: dict[tuple[str, str, Which], Pairs] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        other = theirs.get((*row[2:4], *row[6:10]))
        if row.recipe != OURS or other is None or not math.isfinite(row.value + other):
            continue
        for yaw in labels[row.protocol, row.dataset, row.yaw][:2]:
            found[row.filler, yaw, (row.region, row.modality, row.metric)][row.scene].append((row.value, other))
    return found


def _in_order(places: Collection[tuple[str, str]]) -> list[tuple[str, str]]:
    """Filler and yaw: fillers as they come, and of each the yaws in a row."""
    fillers = list(dict.fromkeys(filler for filler, _ in places))
    single = len({yaw for _, yaw in places} - {ALL}) == 1  # then `all` is the same
    kept = [place for place in places if not (single and place[1] == ALL)]
    return sorted(kept, key=lambda place: (fillers.index(place[0]), yaw_order(place[1])))


def _cell(pairs: Pairs | None, metric: str, seed: int) -> Cell:
    """The change of the mean in %, of PSNR in dB. Both recipes get the same resamples of scenes: their common spread cancels."""
    side = better_direction(metric)
    if not pairs or side == 0:
        return EMPTY
    ours, theirs = np.array([*itertools.chain(*pairs.values())]).T
    sums = np.array([[math.fsum(numbers) for numbers in zip(*scene)] for scene in pairs.values()]).T
    if (ours == theirs).all():
        return Cell("the same", 0.0)
    better = f"({(side * (ours - theirs) > 0).sum()}/{len(ours)})"
    if metric == "psnr":  # a logarithm: its differences count, not its ratios
        counts = np.array([len(scene) for scene in pairs.values()], np.float64)
        gain = float((ours - theirs).mean())
        ends = interval(sums[0] - sums[1], counts, seed)
        return Cell(f"{gain:+.2f} dB {better}", gain, gain > 0, " to ".join(f"{end:+.2f}" for end in ends))
    if not (sums[1] > 0).all():
        return EMPTY
    change = 100 * (float(sums[0].sum() / sums[1].sum()) - 1)
    ends = interval(sums[0], sums[1], seed)
    text = " to ".join(f"{100 * (end - 1):+.1f}" for end in ends)
    return Cell(f"{change:+.1f} % {better}", change, best=side * change > 0, interval=text)
