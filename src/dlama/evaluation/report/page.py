"""Sections, panels and the settings behind them in; one HTML page that loads nothing else out.

The template is page.html of src/dlama/assets/report.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from dlama.evaluation.report.panels import ShownPanel
from dlama.evaluation.report.sections import Section
from dlama.evaluation.report.tables import Table
from dlama.evaluation.report.templates import template
from dlama.evaluation.runner.strips import COLOR_FULL, COLUMNS, DEPTH_FULL

CHOICES = ("protocol", "yaw", "method")
"""The fields of a panel by which readers choose."""


def page(
    title: str,
    about: Mapping[str, Any],
    explained: Mapping[str, str],
    sections: Sequence[Section],
    panels: Sequence[ShownPanel],
    every: Table,
    failures: Sequence[str] = (),
) -> str:
    """The page, as HTML: failures and pictures first, then the sections, the long table and the settings.

    Args:
        about: the settings and versions at the end: name -> text, number or mapping. `lead` stands at the top.
        explained: protocol's title -> a sentence that says what it measures.
        every: the long table that can be searched.
        failures: a line each.
    Raises:
        MissingExtraError: jinja2 is not installed.
    """
    return str(
        template("page.html", "evaluate").render(
            title=title,
            about=about,
            explained=explained,
            sections=sections,
            panels=panels,
            choices={name: list(dict.fromkeys(getattr(one.chosen, name) for one in panels)) for name in CHOICES},
            columns=COLUMNS,
            color_full=f"{COLOR_FULL:g}",
            depth_full=f"{100 * DEPTH_FULL:g} %",
            every=every,
            failures=failures,
            settings=[(name, text) for name, text in flatten(about) if name != "lead"],
        )
    )


def flatten(about: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """(`versions numpy`, `2.1`): nested mappings as lines."""
    for name, value in about.items():
        if isinstance(value, Mapping):
            yield from flatten(value, f"{before}{name} ")
        else:
            text = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
            yield f"{before}{name}".replace("_", " "), text
