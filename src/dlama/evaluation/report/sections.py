"""A Summary and timings in; the report's sections (text, tables) out, the same for markdown and HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from dlama.evaluation.metrics.pictures import SETTINGS
from dlama.evaluation.protocols.scores import MODALITY as CONFIDENCE
from dlama.evaluation.report.columns import (
    HIDDEN,
    INTEREST,
    KNOWN,
    PAPER_MASK_RATIO,
    PAPER_SHAPE,
    PAPER_SOURCE,
    PER_YAW_HIDDEN,
    REMOVAL,
    VARIANT_METRICS,
    WHOLE,
    Which,
    list_columns,
)
from dlama.evaluation.report.paired_comparison import paired_comparison
from dlama.evaluation.report.reliability import RELIABILITY_TEXT, reliability_tables
from dlama.evaluation.report.summary import ALL, Place, Summary
from dlama.evaluation.report.tables import Table, by_yaw, runtimes, side_by_side, variant_of, variants
from dlama.evaluation.runner.store import Row

PROTOCOLS = {
    "vpi": "View change (VPI)",
    "ori": "Object removal (ORI)",
    "sii": "Stereo (SII)",
}
EXPLAINED = {
    "vpi": "VPI, virtual projected inpainting: a source frame is shown from the camera of a target frame, its holes are "
    "filled, and the result is compared with the true target frame.",
    "ori": "ORI, object removal inpainting: an object is removed from a frame by its mask, and the filled background is "
    "compared with the true frame without the object.",
    "sii": "SII, stereoscopic image inpainting: an object is removed from both views of a rectified stereo pair or, where "
    "there are no masks, the right view is made from the left; the result is compared with the true pair.",
}
"""A sentence each for readers who do not know the paper's abbreviations."""


@dataclass(frozen=True)
class Section:
    """A heading with what stands under it."""

    anchor: str
    title: str
    text: str = ""
    tables: tuple[Table, ...] = ()


def sections(summary: Summary, rows: Sequence[Row], timings: Sequence[Row], seed: int = 0) -> list[Section]:
    """Everything the report shows but the panels, in order; paired intervals are drawn with the seed."""
    found: list[Section] = []
    for place in summary.places():
        found += _Part(place, rows, seed).sections()
    clock = runtimes(timings, list(dict.fromkeys(row.method for row in timings)))
    if clock:
        text = (
            "Seconds of the completion alone (its stages, metrics not counted), and the largest resident memory of the whole "
            "process, metrics included. They differ from run to run, so they are not in results.csv."
        )
        found.append(Section("runtime", "Runtime and memory", text, tables=(clock,)))
    return found


_DEPTH_TEXT = (
    f"Depth MAE and RMSE: both depths cut at {SETTINGS.depth_clip_m:g} m, where sky counts, too. AbsRel and δ: true depth below "
    "infinity, not cut."
)
_WHOLE_TEXT = (
    f"Whole pictures, as in the paper: colour 0..255, depth clipped at {SETTINGS.depth_clip_m:g} m and shown as 0..255. Mean "
    f"over frames; the interval is a 95 % bootstrap over scenes (none where there is one scene). {_DEPTH_TEXT}"
)
_HIDDEN_TEXT = (
    "Only pixels that the source camera could not see, by the true depth: the same pixels for every method, "
    f"so a recipe gains nothing by leaving less to fill. {_DEPTH_TEXT}"
)
_REGION_TEXT = (
    f"Means over frames; the interval is a 95 % bootstrap over scenes (none where there is one scene). {_DEPTH_TEXT}"
)


class _Part:
    """The sections of one protocol on one data set."""

    def __init__(self, place: Place, rows: Sequence[Row], seed: int) -> None:
        self.place, self.rows, self.seed = place, rows, seed
        own = set(place.values("method"))
        self.yaws = [yaw for yaw in place.values("yaw") if yaw != ALL]
        """Those that were measured, signs together and by themselves."""
        self.methods = [one for one in place.summary.methods if one in own and not variant_of(one)[1]]
        """Those that are no variant."""
        self.measured = list(dict.fromkeys((key.region, key.modality, key.metric) for key in place.of(yaw=ALL)))
        """What was measured of the methods as named."""

    def sections(self) -> Iterator[Section]:
        """In the report's order."""
        protocol, name = self.place.protocol, f"{PROTOCOLS[self.place.protocol]} on {self.place.dataset}"
        if protocol == "vpi" and self.yaws:
            compared = any(yaw in PAPER_MASK_RATIO for yaw in self.yaws)
            whole = f"{_WHOLE_TEXT} The paper's numbers: {PAPER_SOURCE}" if compared else _WHOLE_TEXT
            yield Section(f"{protocol}-whole", name, whole, self.whole_tables())
            yield Section(f"{protocol}-unseen", f"{name}: unseen", _HIDDEN_TEXT, self.hidden_tables())
        else:
            yield Section(f"{protocol}-regions", name, _REGION_TEXT, self.removal_tables())
        reliable = reliability_tables(self.place, self.methods)
        if reliable:
            yield Section(f"{protocol}-confidence", f"{name}: confidence", RELIABILITY_TEXT, reliable)
        more = self.more_tables()
        if more:
            yield Section(f"{protocol}-more", f"{name}: artifacts and variants", "", tables=more)

    def whole_tables(self) -> tuple[Table, ...]:
        """The recipes against each other, then the paper's tables: a row a yaw and method."""
        both, signs = ([yaw for yaw in self.yaws if (yaw[0] in "+-") == own] for own in (False, True))
        tables = by_yaw(self.place, WHOLE, self.methods, both, "Whole pictures")
        by_sign = by_yaw(self.place, WHOLE, self.methods, signs, "Whole pictures, each sign by itself")
        return _drop_missing(self._paired_table(PAPER_SHAPE), tables, _fold(by_sign))

    def hidden_tables(self) -> tuple[Table, ...]:
        """By yaw, and all regions over all yaws."""
        both = [yaw for yaw in self.yaws if yaw[0] not in "+-"]
        table = by_yaw(self.place, PER_YAW_HIDDEN, self.methods, both, "Unseen pixels")
        return _drop_missing(self._paired_table(PER_YAW_HIDDEN), table, *self.region_tables())

    def removal_tables(self) -> tuple[Table, ...]:
        """The recipes against each other in the mask, then all regions."""
        found = {which[0] for which in self.measured}
        chosen = REMOVAL if "mask" in found else tuple(("unseen", *which[1:]) for which in REMOVAL)
        return _drop_missing(self._paired_table(chosen), *self.region_tables())

    def region_tables(self) -> Iterator[Table | None]:
        """Regions that were hidden, and those that were not; all yaws together."""
        for title, regions in (("Hidden regions", HIDDEN), ("Known regions", KNOWN)):
            yield side_by_side(self.place, self._interesting(regions), self.methods, title)

    def more_tables(self) -> tuple[Table, ...]:
        """What is neither of a common metric nor of the method as named."""
        shown = {*self._interesting(HIDDEN), *self._interesting(KNOWN)}
        rest = [which for which in self.measured if which not in shown and which[1] != CONFIDENCE]
        different = variants(self.place, VARIANT_METRICS, "Variants: another mask, another dilation")
        others = side_by_side(self.place, rest, self.methods, "All other measures")
        return _drop_missing(different, _fold(others))

    def _interesting(self, regions: Sequence[str]) -> list[Which]:
        return [which for which in list_columns(regions, INTEREST) if which in self.measured]

    def _paired_table(self, chosen: Sequence[Which]) -> Table | None:
        return paired_comparison(self.rows, self.place.protocol, self.place.dataset, chosen, self.seed)


def _drop_missing(*tables: Table | None) -> tuple[Table, ...]:
    return tuple(table for table in tables if table is not None)


def _fold(table: Table | None) -> Table | None:
    """A table that is folded away at first."""
    return None if table is None else replace(table, minor=True)
