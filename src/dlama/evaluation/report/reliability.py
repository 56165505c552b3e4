"""A Summary in; the section about confidence (reliability curve, calibration, sparsification) and its lines out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dlama.evaluation.metrics.reliability import BINS, Bins
from dlama.evaluation.protocols.reliability import MODALITY, REGION
from dlama.evaluation.report.charts import Figure, against_diagonal
from dlama.evaluation.report.summary import ALL, Key, Summary
from dlama.evaluation.report.tables import EMPTY, Cell, Table

RELIABILITY_TEXT = (
    "How far the confidence of filled pixels can be relied on. Right: depth within 5 % and colour within 25 levels "
    "(more where even the pixels that both frames show disagree). "
    "ECE: expected calibration error, ten bins over all frames. AUSE: area between the sparsification curve and an oracle's, in "
    "mean errors (0: the least confident pixels are the most wrong), of depth by confidence, of colour by its expected error; "
    "compared with the distance from the rim of the hole and a random order. Expected errors next to the actual ones, of depth "
    "at most the depth itself."
)
COLUMNS = {
    "right": "right",
    "predicted": "predicted",
    "ece": "ECE",
    "ause_depth": "AUSE depth",
    "ause_depth_distance": "by distance",
    "ause_depth_random": "random",
    "ause_color": "AUSE colour",
    "ause_color_distance": "by distance",
    "ause_color_random": "random",
    "expected_depth": "depth, m: expected",
    "actual_depth": "actual",
    "expected_color": "colour: expected",
    "actual_color": "actual",
}


def bins_of(summary: Summary, protocol: str, dataset: str, method: str) -> Bins | None:
    """The bins of a method over all frames of a data set; None where nothing was filled."""
    place = (protocol, dataset, ALL, method, REGION, MODALITY)
    keys = [[Key(*place, f"bin_{k}_{name}") for k in range(BINS)] for name in Bins._fields]
    if keys[0][0] not in summary.means:
        return None
    return Bins(*(np.array([summary.means[key].value for key in row]) for row in keys))


def values_of(summary: Summary, protocol: str, dataset: str, method: str) -> dict[str, float]:
    """COLUMNS of a method over all frames: means, and the ECE of all pixels together; empty where nothing was filled."""
    bins = bins_of(summary, protocol, dataset, method)
    if bins is None:
        return {}
    keys = {name: Key(protocol, dataset, ALL, method, REGION, MODALITY, name) for name in COLUMNS}
    found = {name: summary.means[key].value for name, key in keys.items() if key in summary.means}
    return found | {"ece": bins.error}


def reliability_tables(summary: Summary, protocol: str, dataset: str, methods: Sequence[str]) -> tuple[Table, ...]:
    """A row a method: calibration, sparsification, expected errors; and the reliability curve, a column a bin."""
    rows, curve = [], []
    for method in methods:
        found, bins = values_of(summary, protocol, dataset, method), bins_of(summary, protocol, dataset, method)
        if bins is None:
            continue
        cells = (Cell(f"{found[name]:.3f}", found[name]) if name in found else EMPTY for name in COLUMNS)
        rows.append((Cell(method), *cells))
        curve.append((Cell(method), *(_bin(*numbers) for numbers in zip(bins.share, bins.right))))
    if not rows:
        return ()
    tenths = (f"{100 * k // BINS} to {100 * (k + 1) // BINS} %" for k in range(BINS))
    note = "Share that is right of the pixels whose confidence lies in each bin (the bin's share of all pixels)."
    return (
        Table("Confidence", ("method", *COLUMNS.values()), tuple(rows)),
        Table("Reliability curve", ("method", *tenths), tuple(curve), note),
    )


def _bin(share: float, right: float) -> Cell:
    return EMPTY if share <= 0 else Cell(f"{right / share:.2f} ({share:.0%})", right / share)


def reliability_figure(summary: Summary, protocol: str, dataset: str, methods: Sequence[str]) -> Figure | None:
    """Predicted against right, bin by bin, a line a method, and the diagonal."""
    lines = {}
    for method in methods:
        bins = bins_of(summary, protocol, dataset, method)
        if bins is not None:
            some = bins.share >= 0.005
            lines[method] = list(zip(bins.predicted[some] / bins.share[some], bins.right[some] / bins.share[some]))
    if not lines:
        return None
    return against_diagonal(lines, ("confidence", "share that is right"), "Reliability", (protocol, dataset))


def reliability_lines(summary: Summary) -> list[str]:
    """A line a protocol, data set and method: what `dlama evaluate` prints."""
    lines = []
    for protocol in summary.values("protocol"):
        for dataset in summary.values("dataset", protocol=protocol):
            for method in summary.values("method", protocol=protocol, dataset=dataset):
                found = values_of(summary, protocol, dataset, method)
                if not found or "+" in method:
                    continue
                parts = [f"right {found['right']:.1%}, predicted {found['predicted']:.1%}, ECE {found['ece']:.3f}"]
                for name, word in (("depth", "depth"), ("color", "colour")):
                    if f"ause_{name}" in found:
                        own, formula, random = (found[f"ause_{name}{end}"] for end in ("", "_distance", "_random"))
                        parts.append(f"AUSE {word} {own:.2f} (by distance {formula:.2f}, random {random:.2f})")
                lines.append(f"confidence of {method}, {protocol} on {dataset}: {', '.join(parts)}")
    return lines
