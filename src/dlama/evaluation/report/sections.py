"""A Summary and timings in; the report's sections (text, figures, tables) out, the same for markdown and HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from dlama.evaluation.protocols.methods import NO_FILL
from dlama.evaluation.report.charts import curves, dots
from dlama.evaluation.report.metric_names import MASK_RATIO, PAPER_SHAPE, Which
from dlama.evaluation.report.paired_comparison import duel
from dlama.evaluation.report.paper_columns import MASK_RATIO as MASK_RATIOS
from dlama.evaluation.report.paper_columns import SOURCE
from dlama.evaluation.report.summary import Summary
from dlama.evaluation.report.tables import Table, paper_shaped, per_yaw, runtimes, side_by_side, variant_of, variants
from dlama.evaluation.runner.results_table import Row

PROTOCOLS = {
    "vpi": "View change (VPI)",
    "ori": "Object removal (ORI)",
    "sii": "Stereo (SII)",
}
HIDDEN = ("unseen", "disoccluded", "out-of-view", "object", "mask", "mask-right")
"""Regions that the source camera did not see, by the truth: what a filler is for."""
KNOWN = ("seen", "ring", "outside", "shadow", "whole")
INTEREST = tuple(
    (modality, metric)
    for modality, metrics in {
        "rgb": ("ssim", "lpips", "mse", "psnr"),
        "depth": ("ssim", "lpips", "mse"),
        "depth_m": ("mae", "absrel", "delta1.05", "delta1.25"),
        "disparity": ("bad-1", "bad-2", "epe"),
        "cloud": ("accuracy", "completeness", "fscore_0.02", "fscore_0.05", "fscore_0.10"),
    }.items()
    for metric in metrics
)
"""What the main tables show; everything else is in `every mean` and in the tables of troubles."""
CURVES: tuple[tuple[str, str], ...] = (
    ("rgb", "ssim"), ("rgb", "lpips"), ("rgb", "psnr"), ("depth", "lpips"), ("depth", "mse"), ("depth_m", "mae"),
)  # fmt: skip
BESIDE: tuple[Which, ...] = (("whole", "rgb", "psnr"), ("whole", "depth_m", "mae"), MASK_RATIO)
PER_YAW_HIDDEN: tuple[Which, ...] = (
    ("unseen", "rgb", "lpips"),
    ("unseen", "rgb", "psnr"),
    ("unseen", "depth_m", "mae"),
)
REMOVAL: tuple[Which, ...] = tuple(
    ("mask", modality, metric)
    for modality, metric in (
        *(("rgb", "ssim"), ("rgb", "lpips"), ("rgb", "mse"), ("depth_m", "mae")),
        *(("cloud", "fscore_0.05"), ("disparity", "bad-1")),
    )
)
VARIANT_METRICS: tuple[Which, ...] = tuple(
    (region, modality, metric)
    for region in ("whole", "unseen", "mask")
    for modality, metric in (("rgb", "ssim"), ("rgb", "lpips"), ("rgb", "mse"), ("depth", "mse"), ("depth_m", "mae"))
)


@dataclass(frozen=True)
class Section:
    """A heading with what stands under it."""

    anchor: str
    title: str
    text: str = ""
    figures: tuple[tuple[str, str], ...] = ()
    """(caption, SVG)."""
    tables: tuple[Table, ...] = ()


def sections(summary: Summary, rows: Sequence[Row], timings: Sequence[Row]) -> list[Section]:
    """Everything the report shows but the panels, in order."""
    found: list[Section] = []
    for protocol in sorted(summary.values("protocol"), key=list(PROTOCOLS).index):
        for dataset in summary.values("dataset", protocol=protocol):
            found += _protocol_sections(summary, rows, protocol, dataset)
    clock = runtimes(timings, list(dict.fromkeys(row.method for row in timings)))
    if clock:
        text = (
            "Seconds of the completion alone (its stages, metrics not counted); the largest resident memory of the whole "
            "process meanwhile, metrics included. They are of this machine and day, so they stay out of results.csv."
        )
        found.append(Section("runtime", "Runtime and memory", text, tables=(clock,)))
    return found


def _protocol_sections(summary: Summary, rows: Sequence[Row], protocol: str, dataset: str) -> Iterator[Section]:
    name = f"{PROTOCOLS.get(protocol, protocol)} on {dataset}"
    place = _Place(summary, rows, protocol, dataset)
    if protocol == "vpi" and place.has_yaws:
        yield Section(f"{protocol}-whole", name, place.whole_text(), place.whole_figures(), place.whole_tables())
        text = (
            "Only pixels that the source camera could not see, by the true depth: the same pixels for every method, "
            "so recipes cannot win by leaving less to fill."
        )
        yield Section(f"{protocol}-unseen", f"{name}: unseen", text, place.hidden_figures(), place.hidden_tables())
    else:
        yield Section(f"{protocol}-regions", name, _REGION_TEXT, place.region_figures(), place.removal_tables())
    more = place.more_tables()
    if more:
        yield Section(f"{protocol}-more", f"{name}: troubles and variants", "", tables=more)


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

    @property
    def has_yaws(self) -> bool:
        return len(self.summary.values("yaw", protocol=self.protocol, dataset=self.dataset)) > 1

    @property
    def methods(self) -> list[str]:
        """Those that are no variant."""
        own = set(self.summary.values("method", protocol=self.protocol, dataset=self.dataset))
        return [one for one in self.summary.methods if one in own and not variant_of(one)[1]]

    @property
    def drawn(self) -> list[str]:
        """Those in figures: black holes are so far off that nothing else could be told apart; they stand in the tables."""
        return [one for one in self.methods if not one.endswith(f"/{NO_FILL}")] or self.methods

    @property
    def every(self) -> list[Which]:
        """What was measured of the methods as named."""
        keys = self.summary.of(protocol=self.protocol, dataset=self.dataset, yaw="all")
        return list(dict.fromkeys((key.region, key.modality, key.metric) for key in keys))

    def whole_text(self) -> str:
        """With the source of the paper's numbers, where they stand beside ours."""
        yaws = self.summary.values("yaw", protocol=self.protocol, dataset=self.dataset)
        beside = f" The column of the paper: {SOURCE}" if any(yaw in MASK_RATIOS for yaw in yaws) else ""
        return _WHOLE_TEXT + beside

    def whole_figures(self) -> tuple[tuple[str, str], ...]:
        """The paper's six numbers and mask ratio, and two in other units, over yaw."""
        return self._curves((*PAPER_SHAPE, *BESIDE), "Whole pictures over yaw")

    def hidden_figures(self) -> tuple[tuple[str, str], ...]:
        """The unseen pixels over yaw."""
        return self._curves([("unseen", *which) for which in CURVES], "Unseen pixels over yaw")

    def region_figures(self) -> tuple[tuple[str, str], ...]:
        """The hidden region's metrics, a dot a method."""
        hidden = [region for region in HIDDEN if any(which[0] == region for which in self.every)][:1]
        chosen = self._interesting(hidden or ["whole"])[:12]
        title = f"{(hidden or ['whole'])[0]}: mean and 95 % interval"
        figure = dots(self.summary, self.protocol, self.dataset, chosen, self.drawn, title)
        return ((title, figure),) if figure else ()

    def whole_tables(self) -> tuple[Table, ...]:
        """One a metric with the methods side by side, then one a method in the paper's shape."""
        place = self.summary, self.protocol, self.dataset
        beside = [per_yaw(*place, which, self.methods) for which in PAPER_SHAPE]
        single = [per_yaw(*place, which, self.methods, signs=True) for which in PAPER_SHAPE]
        own = [paper_shaped(*place, method) for method in self.methods]
        against = duel(self.rows, self.protocol, self.dataset, PAPER_SHAPE)
        return (*_there([against, *beside]), *_there(own), *_minor(_there(single), "each sign by itself"))

    def hidden_tables(self) -> tuple[Table, ...]:
        """By yaw, and all regions over all yaws."""
        place = self.summary, self.protocol, self.dataset
        against = duel(self.rows, self.protocol, self.dataset, PER_YAW_HIDDEN)
        by_yaw = [per_yaw(*place, which, self.methods) for which in PER_YAW_HIDDEN]
        return (*_there([against, *by_yaw]), *self.region_tables())

    def removal_tables(self) -> tuple[Table, ...]:
        """The recipes against each other in the mask, then all regions."""
        found = {which[0] for which in self.every}
        chosen = REMOVAL if "mask" in found else tuple(("unseen", *which[1:]) for which in REMOVAL)
        return (*_there([duel(self.rows, self.protocol, self.dataset, chosen)]), *self.region_tables())

    def region_tables(self) -> tuple[Table, ...]:
        """Regions that were hidden, and those that were not; all yaws together."""
        titles = {"Hidden regions": HIDDEN, "Known regions": KNOWN}
        tables = [self._side_by_side(self._interesting(regions), title) for title, regions in titles.items()]
        return _there(tables)

    def more_tables(self) -> tuple[Table, ...]:
        """What is neither of a common metric nor of the method as named."""
        shown = {*self._interesting(HIDDEN), *self._interesting(KNOWN)}
        rest = [which for which in self.every if which not in shown]
        main = VARIANT_METRICS
        different = variants(
            self.summary, self.protocol, self.dataset, main, "Variants: another mask, another dilation"
        )
        folded = _minor(_there([self._side_by_side(rest, "All other measures")]), "")
        return (*_there([different]), *folded)

    def _interesting(self, regions: Sequence[str]) -> list[Which]:
        every = set(self.every)
        return [(region, *which) for region in regions for which in INTEREST if (region, *which) in every]

    def _side_by_side(self, chosen: Sequence[Which], title: str) -> Table | None:
        return side_by_side(self.summary, self.protocol, self.dataset, chosen, self.methods, title)

    def _curves(self, chosen: Sequence[Which], title: str) -> tuple[tuple[str, str], ...]:
        figure = curves(self.summary, self.protocol, self.dataset, chosen, self.drawn, title)
        return ((title, figure),) if figure else ()


def _there(tables: Sequence[Table | None]) -> tuple[Table, ...]:
    return tuple(table for table in tables if table is not None)


def _minor(tables: Sequence[Table], how: str) -> tuple[Table, ...]:
    ending = f", {how}" if how else ""
    return tuple(Table(f"{one.title}{ending}", one.head, one.rows, one.note, minor=True) for one in tables)
