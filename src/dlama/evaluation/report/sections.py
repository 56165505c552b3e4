"""A Summary and timings in; the report's sections (text, figures, tables) out, the same for markdown and HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from dlama.evaluation.protocols.methods import NO_FILL
from dlama.evaluation.protocols.reliability import MODALITY as CONFIDENCE
from dlama.evaluation.report.charts import Figure, curves, dots
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
    Which,
)
from dlama.evaluation.report.paired_comparison import paired_comparison
from dlama.evaluation.report.reliability import RELIABILITY_TEXT, reliability_figure, reliability_tables
from dlama.evaluation.report.summary import ALL, Summary
from dlama.evaluation.report.tables import (
    Table,
    by_method,
    paper_table,
    per_yaw,
    runtimes,
    side_by_side,
    variant_of,
    variants,
)
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
        yield Section(f"{protocol}-regions", name, _REGION_TEXT, place.region_figures(), place.removal_tables())
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
    def has_one_yaw(self) -> bool:
        """Tables over yaw would have one row each."""
        return len([yaw for yaw in self.yaws if yaw[0] not in "+-"]) == 1

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
        return self._figures_of((*PAPER_SHAPE, *MORE_WHOLE), "Whole pictures")

    def hidden_figures(self) -> tuple[Figure, ...]:
        """The unseen pixels."""
        return self._figures_of([("unseen", *which) for which in CURVES], "Unseen pixels")

    def region_figures(self) -> tuple[Figure, ...]:
        """The hidden region's metrics, a dot a method."""
        hidden = [region for region in HIDDEN if any(which[0] == region for which in self.all_measures)][:1]
        chosen = self._interesting(hidden or ["whole"])[:12]
        return self._figures_of(chosen, f"Region {(hidden or ['whole'])[0]}")

    def whole_tables(self) -> tuple[Table, ...]:
        """One a metric with the methods side by side, then one a method in the paper's shape; of one yaw, one of all."""
        place = self.summary, self.protocol, self.dataset
        against = self._paired_table(PAPER_SHAPE)
        if self.has_one_yaw:
            both, signs = ([yaw for yaw in self.yaws if (yaw[0] in "+-") == own] for own in (False, True))
            by_sign = _mark_minor(_drop_missing([by_method(*place, self.methods, signs)]), "each sign by itself")
            return (*_drop_missing([against, by_method(*place, self.methods, both)]), *by_sign)
        yaw_tables = [per_yaw(*place, which, self.methods) for which in PAPER_SHAPE]
        single = [per_yaw(*place, which, self.methods, signs=True) for which in PAPER_SHAPE]
        own = [paper_table(*place, method) for method in self.methods]
        return (
            *_drop_missing([against, *yaw_tables]),
            *_drop_missing(own),
            *_mark_minor(_drop_missing(single), "each sign by itself"),
        )

    def hidden_tables(self) -> tuple[Table, ...]:
        """By yaw where there are several, and all regions over all yaws."""
        place = self.summary, self.protocol, self.dataset
        against = self._paired_table(PER_YAW_HIDDEN)
        by_yaw = [] if self.has_one_yaw else [per_yaw(*place, which, self.methods) for which in PER_YAW_HIDDEN]
        return (*_drop_missing([against, *by_yaw]), *self.region_tables())

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

    def _figures_of(self, chosen: Sequence[Which], title: str) -> tuple[Figure, ...]:
        """Curves over yaw where there are two yaws or more, else a dot a method."""
        place = self.summary, self.protocol, self.dataset
        over_yaw = (
            None if self.protocol != "vpi" else curves(*place, chosen, self.methods_in_figures, f"{title} over yaw")
        )
        figure = over_yaw or dots(*place, chosen, self.methods_in_figures, f"{title}, mean over frames")
        return (figure,) if figure else ()


def _drop_missing(tables: Sequence[Table | None]) -> tuple[Table, ...]:
    return tuple(table for table in tables if table is not None)


def _mark_minor(tables: Sequence[Table], how: str) -> tuple[Table, ...]:
    ending = f", {how}" if how else ""
    return tuple(replace(one, title=f"{one.title}{ending}", minor=True) for one in tables)
