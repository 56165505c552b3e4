"""A Summary in; the section about confidence (reliability curve, calibration, sparsification) and its lines out."""

from __future__ import annotations

from collections.abc import Sequence

from dlama.evaluation.metrics.reliability import BINS, Bins
from dlama.evaluation.protocols.scores import MODALITY, REGION
from dlama.evaluation.report.summary import ALL, Place, Summary
from dlama.evaluation.report.tables import EMPTY, Cell, Table

RELIABILITY_TEXT = (
    "How far the confidence of filled pixels can be relied on. Right: depth within 5 % and colour within 25 levels "
    "(more where even the pixels that both frames show disagree). "
    "ECE: expected calibration error, ten bins over all frames. AUSE: area between the sparsification curve and an oracle's, in "
    "mean errors (0: the least confident pixels are the most wrong), of depth by confidence, of colour by its expected error; "
    "compared with the distance from the rim of the hole and a random order. Expected errors next to the actual ones, of depth "
    "at most the depth itself, and not cut."
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


def values_of(place: Place, method: str) -> tuple[dict[str, float], Bins] | None:
    """COLUMNS of a method over all frames (means, and the ECE of all pixels together), and its bins; None: nothing was filled."""
    measured = place.of(yaw=ALL, method=method, region=REGION, modality=MODALITY)
    found = {key.metric: one.value for key, one in measured.items()}
    if "bin_0_share" not in found:
        return None
    bins = Bins.of_measures(found)
    return found | {"ece": bins.error}, bins


def reliability_tables(place: Place, methods: Sequence[str]) -> tuple[Table, ...]:
    """A row a method: calibration, sparsification, expected errors; and the reliability curve, a column a bin."""
    rows, curve = [], []
    for method in methods:
        measured = values_of(place, method)
        if measured is None:
            continue
        found, bins = measured
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


def reliability_lines(summary: Summary) -> list[str]:
    """A line a protocol, data set and method: what `dlama evaluate` prints."""
    lines = []
    for place in summary.places():
        for method in place.values("method"):
            measured = values_of(place, method)
            if measured is None or "+" in method:
                continue
            found = measured[0]
            parts = [f"right {found['right']:.1%}, predicted {found['predicted']:.1%}, ECE {found['ece']:.3f}"]
            for name, word in (("depth", "depth"), ("color", "colour")):
                if f"ause_{name}" in found:
                    own, formula, random = (found[f"ause_{name}{end}"] for end in ("", "_distance", "_random"))
                    parts.append(f"AUSE {word} {own:.2f} (by distance {formula:.2f}, random {random:.2f})")
            lines.append(f"confidence of {method}, {place.protocol} on {place.dataset}: {', '.join(parts)}")
    return lines
