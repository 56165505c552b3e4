"""A Summary and timings in; the report's sections (text, figures, tables) out, the same for markdown and HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from dlama.evaluation.protocols.methods import NO_FILL
from dlama.evaluation.protocols.reliability import MODALITY as CONFIDENCE
from dlama.evaluation.report.charts import Figure, curves
from dlama.evaluation.report.columns import (
    CURVES,
    HIDDEN,
    INTEREST,
    KNOWN,
    MORE_WHOLE,
    PAPER_MASK_RATIO,
    PAPER_SHAPE,
    PAPER_SOURCE,
    PER_YAW_HIDDEN,
    POINTED,
    REMOVAL,
    VARIANT_METRICS,
    WHOLE,
    Which,
)
from dlama.evaluation.report.paired_comparison import paired_comparison
from dlama.evaluation.report.reliability import RELIABILITY_TEXT, reliability_figure, reliability_tables
from dlama.evaluation.report.summary import ALL, Summary
from dlama.evaluation.report.tables import Table, by_yaw, runtimes, side_by_side, variant_of, variants
from dlama.evaluation.runner.store import Row

PROTOCOLS = {
    "vpi": "View change (VPI)",
    "ori": "Object removal (ORI)",
    "sii": "Stereo (SII)",
    "mask": "Object masks (MASK)",
}
EXPLAINED = {
    "vpi": "VPI, virtual projected inpainting: a source frame is shown from the camera of a target frame, its holes are "
    "filled, and the result is compared with the true target frame.",
    "ori": "ORI, object removal inpainting: an object is removed from a frame by its mask, and the filled background is "
    "compared with the true frame without the object.",
    "sii": "SII, stereoscopic image inpainting: an object is removed from both views of a rectified stereo pair or, where "
    "there are no masks, the right view is made from the left; the result is compared with the true pair.",
    "mask": "MASK, an object pointed at: its mask is found by clicks (one, then up to three corrections) and by a box, "
    "compared with the true mask and with GrabCut alone, and used to remove the object.",
}
"""A sentence each for readers who do not know the paper's abbreviations."""


@dataclass(frozen=True)
class Section:
    """A heading with what stands under it."""

    anchor: str
    title: str
    text: str = ""
    figures: tuple[Figure, ...] = ()
    tables: tuple[Table, ...] = ()


def protocols_of(summary: Summary) -> list[str]:
    """The protocols that ran, in the report's order."""
    return sorted(summary.values("protocol"), key=list(PROTOCOLS).index)


def sections(summary: Summary, rows: Sequence[Row], timings: Sequence[Row], seed: int = 0) -> list[Section]:
    """Everything the report shows but the panels, in order; paired intervals are drawn with the seed."""
    found: list[Section] = []
    for protocol in protocols_of(summary):
        for dataset in summary.values("dataset", protocol=protocol):
            found += _protocol_sections(_Place(summary, rows, protocol, dataset, seed))
    clock = runtimes(timings, list(dict.fromkeys(row.method for row in timings)))
    if clock:
        text = (
            "Seconds of the completion alone (its stages, metrics not counted), and the largest resident memory of the whole "
            "process, metrics included. They differ from run to run, so they are not in results.csv."
        )
        found.append(Section("runtime", "Runtime and memory", text, tables=(clock,)))
    return found


def _protocol_sections(place: _Place) -> Iterator[Section]:
    protocol, name = place.protocol, f"{PROTOCOLS[place.protocol]} on {place.dataset}"
    if protocol == "vpi" and place.has_yaws:
        yield Section(f"{protocol}-whole", name, place.whole_text(), place.whole_figures(), place.whole_tables())
        text = (
            "Only pixels that the source camera could not see, by the true depth: the same pixels for every method, "
            "so a recipe gains nothing by leaving less to fill."
        )
        yield Section(f"{protocol}-unseen", f"{name}: unseen", text, place.hidden_figures(), place.hidden_tables())
    else:
        yield Section(f"{protocol}-regions", name, _REGION_TEXT, tables=place.removal_tables())
    reliable = reliability_tables(place.summary, protocol, place.dataset, place.methods_in_figures)
    if reliable:
        figure = reliability_figure(place.summary, protocol, place.dataset, place.methods_in_figures)
        title = f"{name}: confidence"
        yield Section(f"{protocol}-confidence", title, RELIABILITY_TEXT, (figure,) if figure else (), reliable)
    more = place.more_tables()
    if more:
        yield Section(f"{protocol}-more", f"{name}: artifacts and variants", "", tables=more)


_WHOLE_TEXT = (
    "Whole pictures, as in the paper: colour 0..255, depth clipped at 10 m and shown as 0..255. Mean over frames; the "
    "interval is a 95 % bootstrap over scenes (none where there is one scene)."
)
_REGION_TEXT = "Means over frames; the interval is a 95 % bootstrap over scenes (none where there is one scene)."


@dataclass(frozen=True)
class _Place:
    """One protocol on one data set."""

    summary: Summary
    rows: Sequence[Row]
    protocol: str
    dataset: str
    seed: int

    @property
    def yaws(self) -> list[str]:
        """Those that were measured, signs together and by themselves, without `all`."""
        found = self.summary.values("yaw", protocol=self.protocol, dataset=self.dataset)
        return [yaw for yaw in found if yaw != ALL]

    @property
    def has_yaws(self) -> bool:
        """Whether there are cases with a yaw."""
        return bool(self.yaws)

    @property
    def methods(self) -> list[str]:
        """Those that are no variant."""
        own = set(self.summary.values("method", protocol=self.protocol, dataset=self.dataset))
        return [one for one in self.summary.methods if one in own and not variant_of(one)[1]]

    @property
    def methods_in_figures(self) -> list[str]:
        """Those in figures: black holes are so far off that all others would coincide; they stand in the tables only."""
        return [one for one in self.methods if not one.endswith(f"/{NO_FILL}")] or self.methods

    @property
    def all_measures(self) -> list[Which]:
        """What was measured of the methods as named."""
        keys = self.summary.of(protocol=self.protocol, dataset=self.dataset, yaw="all")
        return list(dict.fromkeys((key.region, key.modality, key.metric) for key in keys))

    def whole_text(self) -> str:
        """With the source of the paper's numbers, where they are compared with ours."""
        source = f" The paper's numbers: {PAPER_SOURCE}" if any(yaw in PAPER_MASK_RATIO for yaw in self.yaws) else ""
        return _WHOLE_TEXT + source

    def whole_figures(self) -> tuple[Figure, ...]:
        """The paper's six numbers and mask ratio, and two in other units."""
        return self._curves_of((*PAPER_SHAPE, *MORE_WHOLE), "Whole pictures over yaw")

    def hidden_figures(self) -> tuple[Figure, ...]:
        """The unseen pixels."""
        return self._curves_of([("unseen", *which) for which in CURVES], "Unseen pixels over yaw")

    def whole_tables(self) -> tuple[Table, ...]:
        """The recipes against each other, then the paper's tables: a row a yaw and method."""
        both, signs = ([yaw for yaw in self.yaws if (yaw[0] in "+-") == own] for own in (False, True))
        minor = _mark_minor(_drop_missing([self._by_yaw(WHOLE, signs, "Whole pictures")]), "each sign by itself")
        return (
            *_drop_missing([self._paired_table(PAPER_SHAPE), self._by_yaw(WHOLE, both, "Whole pictures")]),
            *minor,
        )

    def hidden_tables(self) -> tuple[Table, ...]:
        """By yaw, and all regions over all yaws."""
        both = [yaw for yaw in self.yaws if yaw[0] not in "+-"]
        by_yaw_table = self._by_yaw(PER_YAW_HIDDEN, both, "Unseen pixels")
        return (*_drop_missing([self._paired_table(PER_YAW_HIDDEN), by_yaw_table]), *self.region_tables())

    def removal_tables(self) -> tuple[Table, ...]:
        """The recipes against each other in the mask, then all regions."""
        found = {which[0] for which in self.all_measures}
        chosen = REMOVAL if "mask" in found else tuple(("unseen", *which[1:]) for which in REMOVAL)
        return (*_drop_missing([self._paired_table(chosen)]), *self.region_tables())

    def region_tables(self) -> tuple[Table, ...]:
        """Regions that were hidden, and those that were not; all yaws together."""
        masks = [which for which in self._interesting(POINTED) if which[1] == "mask"]
        titles = {"Hidden regions": HIDDEN, "Known regions": KNOWN}
        chosen = {
            title: [which for which in self._interesting(of) if which[1] != "mask"] for title, of in titles.items()
        }
        return _drop_missing([self._side_by_side(found, title) for title, found in {"Masks": masks, **chosen}.items()])

    def more_tables(self) -> tuple[Table, ...]:
        """What is neither of a common metric nor of the method as named."""
        shown = {*self._interesting(HIDDEN), *self._interesting(KNOWN), *self._interesting(POINTED)}
        rest = [which for which in self.all_measures if which not in shown and which[1] != CONFIDENCE]
        main = VARIANT_METRICS
        different = variants(
            self.summary, self.protocol, self.dataset, main, "Variants: another mask, another dilation"
        )
        folded = _mark_minor(_drop_missing([self._side_by_side(rest, "All other measures")]), "")
        return (*_drop_missing([different]), *folded)

    def _interesting(self, regions: Sequence[str]) -> list[Which]:
        every = set(self.all_measures)
        return [(region, *which) for region in regions for which in INTEREST if (region, *which) in every]

    def _side_by_side(self, chosen: Sequence[Which], title: str) -> Table | None:
        return side_by_side(self.summary, self.protocol, self.dataset, chosen, self.methods, title)

    def _paired_table(self, chosen: Sequence[Which]) -> Table | None:
        return paired_comparison(self.rows, self.protocol, self.dataset, chosen, self.seed)

    def _by_yaw(self, chosen: Sequence[Which], yaws: Sequence[str], title: str) -> Table | None:
        return by_yaw(self.summary, self.protocol, self.dataset, chosen, self.methods, yaws, title)

    def _curves_of(self, chosen: Sequence[Which], title: str) -> tuple[Figure, ...]:
        figure = curves(self.summary, self.protocol, self.dataset, chosen, self.methods_in_figures, title)
        return (figure,) if figure else ()


def _drop_missing(tables: Sequence[Table | None]) -> tuple[Table, ...]:
    return tuple(table for table in tables if table is not None)


def _mark_minor(tables: Sequence[Table], how: str) -> tuple[Table, ...]:
    ending = f", {how}" if how else ""
    return tuple(replace(one, title=f"{one.title}{ending}", minor=True) for one in tables)
