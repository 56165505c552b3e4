"""A finished run in; results.csv, timings.csv, summary.json, summary.md and report.html, a page that loads nothing else, out."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dlama import __version__
from dlama.datasets.frames import Dataset
from dlama.errors import format_count
from dlama.evaluation.metrics.pictures import SETTINGS as METRIC_SETTINGS
from dlama.evaluation.protocols.methods import NO_FILL, ProtocolSettings
from dlama.evaluation.protocols.strips import COLOR_FULL, COLUMNS, DEPTH_FULL
from dlama.evaluation.report.columns import column_title, format_value, list_columns
from dlama.evaluation.report.panels import Chosen, as_data_urls, choose
from dlama.evaluation.report.sections import EXPLAINED, PROTOCOLS, Section, sections
from dlama.evaluation.report.summary import ALL, RESAMPLES, Place, Summary, summarise, write_summary
from dlama.evaluation.report.tables import variant_of
from dlama.evaluation.report.templates import template
from dlama.evaluation.runner.cache_key import code_hash, short_hash, versions
from dlama.evaluation.runner.run import Outcome, Results
from dlama.evaluation.runner.store import write_rows
from dlama.writing.atomic_write import write_file

MAIN = {"rgb": "ssim lpips mse psnr", "depth_m": "mae"}
"""The numbers of a headline."""
CHOICES = ("protocol", "yaw", "method")
"""The fields of a panel by which readers choose."""


def flatten(about: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """(`versions numpy`, `2.1`): nested mappings as lines."""
    for name, value in about.items():
        if isinstance(value, Mapping):
            yield from flatten(value, f"{before}{name} ")
        else:
            text = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
            yield f"{before}{name}".replace("_", " "), text


FILES = ("results.csv", "timings.csv", "summary.json", "summary.md", "report.html")


def write_report(
    folder: Path, dataset: Dataset, run: Results, settings: ProtocolSettings, *, seed: int = 0, command: str = ""
) -> Summary:
    """Write all of it next to the stored results. The same results give the same bytes, except where runtimes are shown.

    Raises:
        OutputError: the folder cannot be written.
        MissingExtraError: jinja2 is not installed.
    """
    rows, timings = ([row for one in run.stored for row in getattr(one, name)] for name in ("rows", "timings"))
    write_rows(folder / "results.csv", rows)
    write_rows(folder / "timings.csv", timings)
    summary = summarise(rows, seed=seed, about=report_meta(dataset, run, settings, seed, command))
    write_summary(folder / "summary.json", summary)
    parts = sections(summary, rows, timings, seed)
    failed = [failure_line(one) for one in run.failures]
    panels = as_data_urls(folder / "panels", choose(run.stored))
    for name, text in render(dataset.name, summary, parts, panels, failed).items():
        write_file(folder / name, text)
    return summary


def render(
    dataset: str,
    summary: Summary,
    sections: Sequence[Section],
    panels: Sequence[tuple[Chosen, str]],
    failures: Sequence[str] = (),
) -> dict[str, str]:
    """summary.md and report.html by their names: failures and pictures first, then the sections and the settings.

    Args:
        failures: a line each.
    Raises:
        MissingExtraError: jinja2 is not installed.
    """
    shown = {
        "about": summary.about,
        "explained": {PROTOCOLS[name]: EXPLAINED[name] for name in summary.values("protocol")},
        "sections": sections,
        "panels": panels,
        "choices": {name: list(dict.fromkeys(getattr(one, name) for one, _ in panels)) for name in CHOICES},
        "columns": COLUMNS,
        "color_full": f"{COLOR_FULL:g}",
        "depth_full": f"{100 * DEPTH_FULL:g} %",
        "failures": failures,
        "settings": [(name, text) for name, text in flatten(summary.about) if name != "lead"],
    }
    titles = {"summary.md": ("summary.md", f"Evaluation on {dataset}")}
    titles["report.html"] = "page.html", f"dlama evaluated on {dataset}"
    return {
        name: str(template(source, "evaluate").render(title=title, **shown)) for name, (source, title) in titles.items()
    }


def report_meta(dataset: Dataset, run: Results, settings: ProtocolSettings, seed: int, command: str) -> dict[str, Any]:
    """What the numbers rest on."""
    rows = [row for one in run.stored for row in one.rows if "+" not in row.recipe]
    cases = {(row.protocol, row.scene, row.frame) for row in rows}
    scenes = list(dict.fromkeys(row.scene for row in rows))
    methods = {row.method for row in rows}
    lead = f"{format_count(len(cases), 'case')} of {format_count(len(scenes), 'scene')}, {format_count(len(methods), 'method')}."
    failed = f" {len(run.failures)} failed and count nowhere." if run.failures else ""
    warned = sorted({line for one in run.stored for line in one.warnings})
    return {
        "lead": lead + failed,
        "dataset": {"name": dataset.name, "layout": dataset.layout, "scenes": scenes, "cases": len(cases)},
        "command": command,
        "settings_hash": settings_hash(settings),
        "metrics": asdict(METRIC_SETTINGS),
        "protocols": asdict(settings),
        "interval": f"95 % bootstrap over scenes, {RESAMPLES} draws, seed {seed}",
        "code": code_hash(),
        "versions": {"dlama": __version__, "python": platform.python_version(), **versions()},
        **({"warnings": warned} if warned else {}),
    }


def settings_hash(settings: ProtocolSettings) -> str:
    """12 hexadecimal digits of the metrics' settings and the protocols' together."""
    return short_hash([METRIC_SETTINGS, settings])[:12]


def failure_line(one: Outcome) -> str:
    """`vpi s03 +10, dlama/telea: FileError: ...`."""
    return f"{one.case.protocol} {one.case.scene} {one.case.frame}, {one.method.label}: {one.error}"


def headlines(summary: Summary) -> list[str]:
    """Of each protocol and data set its methods, variants left out: over all yaws in whole pictures, else in what was removed."""
    lines = []
    for place in summary.places():
        region = "mask" if place.of(region="mask") else "whole"
        lines += [_line(place, region, method) for method in place.values("method") if not variant_of(method)[1]]
    return lines


def _line(place: Place, region: str, method: str) -> str:
    """`vpi on street, dlama/telea, whole (3 frames): colour SSIM 0.8104, ...`; no depth of the baseline that fills nothing: where
    it has any, it was measured."""
    chosen = list_columns((region,), {"rgb": MAIN["rgb"]} if method.endswith(f"/{NO_FILL}") else MAIN)
    means = {which: one for which in chosen if (one := place.mean(ALL, method, which))}
    found = []
    for which, one in means.items():
        title, _, unit = column_title(*which).partition(", ")
        found.append(f"{title} {format_value(one.value, which[2])} {unit}".rstrip())
    frames = max((one.frames for one in means.values()), default=0)
    head = f"{place.protocol} on {place.dataset}, {method}, {region} ({format_count(frames, 'frame')})"
    return f"{head}: {', '.join(found) or 'nothing was measured'}"
