"""Sections, panels and the settings behind them in; one HTML page that loads nothing else out.

The templates, the style and the script lie in src/dlama/assets/report; Jinja2 escapes whatever is not marked as HTML.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from dlama.errors import MissingExtraError
from dlama.evaluation.report.panels import ShownPanel
from dlama.evaluation.report.sections import Section
from dlama.evaluation.report.tables import Table
from dlama.evaluation.runner.strips import COLOR_FULL, COLUMNS, DEPTH_FULL

PARTS = Path(__file__).parents[2] / "assets" / "report"
"""page.html, table.html, panels.html, style.css and script.js."""
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
    return (
        _environment()
        .get_template("page.html")
        .render(
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
            settings=[(name, text) for name, text in flattened(about) if name != "lead"],
        )
    )


def flattened(about: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """(`versions numpy`, `2.1`): nested mappings as lines."""
    for name, value in about.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{before}{name} ")
        else:
            text = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
            yield f"{before}{name}".replace("_", " "), text


def _environment() -> Any:
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
    except ImportError as error:
        raise MissingExtraError("the report", "jinja2", "evaluate") from error
    loader = FileSystemLoader(PARTS)
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.globals["part"] = lambda name: (PARTS / name).read_text(encoding="utf-8").strip()
    return made
