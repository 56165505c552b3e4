"""Sections, panels and what they rest on in; one HTML page that needs nothing else out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from dlama.evaluation.report.panel_choice import Chosen
from dlama.evaluation.report.panels import COLOR_FULL, COLUMNS, DEPTH_FULL
from dlama.evaluation.report.sections import Section
from dlama.evaluation.report.tables import Cell, Table

PARTS = Path(__file__).parents[2] / "assets" / "report"
"""page.html, style.css and script.js."""


def page(
    title: str,
    about: Mapping[str, Any],
    sections: Sequence[Section],
    panels: Sequence[tuple[Chosen, str]],
    every: Table,
    failures: Sequence[str] = (),
) -> str:
    """The page.

    Args:
        about: what stands at its end as settings: name -> text, number or mapping.
        panels: each with its picture as a data: URL.
        every: the long table that can be searched.
        failures: a line each.
    """
    hash_line = f"settings {about['settings_hash']}"
    blocks = [("failed", "What failed", _failures(failures))] if failures else []
    blocks += [(one.anchor, one.title, _section(one, hash_line)) for one in sections]
    blocks += [("panels", "Best, median and worst", _panels(panels))] if panels else []
    blocks += [
        ("every", every.title, _searchable(every, hash_line)),
        ("settings", "Settings and versions", _about(about)),
    ]
    body = "\n".join(
        f'<section id="{name}">\n<h2>{escape(head)}</h2>\n{text}\n</section>' for name, head, text in blocks
    )
    contents = " ".join(f'<a href="#{name}">{escape(head)}</a>' for name, head, _ in blocks)
    parts = {name: (PARTS / name).read_text(encoding="utf-8") for name in ("page.html", "style.css", "script.js")}
    return Template(parts["page.html"]).substitute(
        title=escape(title),
        lead=f'<p>{escape(str(about["lead"]))}</p>\n<p class="quiet">{escape(hash_line)}</p>',
        contents=contents,
        body=body,
        style=parts["style.css"].strip(),
        script=parts["script.js"].strip(),
    )


def table_html(table: Table, hash_line: str, name: str = "") -> str:
    """A table that sorts by a click on a heading; intervals small beside their means."""
    words = [all(row[number].value is None for row in table.rows) for number in range(len(table.head))]
    head = "".join(
        f'<th{_kind(["word"] if word else [])} scope="col"><button type="button">{escape(text)}</button></th>'
        for text, word in zip(table.head, words)
    )
    rows = "\n".join(f"<tr>{''.join(_field(cell, word) for cell, word in zip(row, words))}</tr>" for row in table.rows)
    note = f'<p class="quiet">{escape(table.note)}</p>' if table.note else ""
    caption = f"<caption><b>{escape(table.title)}</b> · {escape(hash_line)}</caption>"
    mark = f' id="{name}"' if name else ""
    whole = (
        f'<table class="sorts"{mark}>\n{caption}\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody>\n</table>'
    )
    tall = " tall" if len(table.rows) > 40 else ""
    return f'<div class="scroll{tall}">{whole}</div>{note}'


def _field(cell: Cell, word: bool) -> str:
    kinds = [name for name, on in (("word", word), ("best", cell.best), ("other", cell.other)) if on]
    value = "" if cell.value is None else f' data-value="{cell.value:.10g}"'
    small = f"<small>{escape(cell.interval)}</small>" if cell.interval else ""
    return f"<td{_kind(kinds)}{value}>{escape(cell.text)}{small}</td>"


def _kind(names: Iterable[str]) -> str:
    joined = " ".join(names)
    return f' class="{joined}"' if joined else ""


def _section(section: Section, hash_line: str) -> str:
    return "\n".join(_section_parts(section, hash_line))


def _section_parts(section: Section, hash_line: str) -> Iterator[str]:
    if section.text:
        yield f"<p>{escape(section.text)}</p>"
    for caption, svg in section.figures:
        told = f"{escape(caption)}. Bands and bars are 95 % intervals over scenes."
        yield f"<figure>\n{svg}\n<figcaption>{told}</figcaption></figure>"
    for table in section.tables:
        whole = table_html(table, hash_line)
        yield f"<details><summary>{escape(table.title)}</summary>{whole}</details>" if table.minor else whole


def _searchable(table: Table, hash_line: str) -> str:
    field = (
        '<label>Only rows with <input type="search" data-table="every-table" placeholder="unseen rgb lpips"></label>'
    )
    whole = table_html(table, hash_line, "every-table")
    return f"<details><summary>{len(table.rows)} means</summary><p>{field}</p>{whole}</details>"


def _panels(panels: Sequence[tuple[Chosen, str]]) -> str:
    """One figure a panel, and choices that leave the wanted ones; at first those of the first protocol, yaw and method."""
    choices = "".join(
        _choice(name, list(dict.fromkeys(getattr(one, name) for one, _ in panels)))
        for name in ("protocol", "yaw", "method")
    )
    error = (
        f"Error: black is none, bright {COLOR_FULL:g} levels or more in colour and {DEPTH_FULL:.0%} of the true depth or more. "
        "Stripes: unknown. Depth: red is near, blue far, pale sky."
    )
    figures = "\n".join(_panel(one, url) for one, url in panels)
    return (
        f'<p class="quiet">{escape(error)} <span class="scale"></span></p>\n'
        f'<div class="pick" data-panels="all-panels">{choices}</div>\n<div id="all-panels">\n{figures}\n</div>'
    )


def _choice(name: str, values: Sequence[str]) -> str:
    options = "".join(f'<option value="{escape(one)}">{escape(one)}</option>' for one in values)
    return f'<label>{name} <select name="{name}">{options}<option value="">every</option></select></label>'


def _panel(one: Chosen, url: str) -> str:
    data = "".join(f' data-{name}="{escape(getattr(one, name))}"' for name in ("protocol", "yaw", "method"))
    heads = "".join(f"<span>{name}</span>" for name in COLUMNS)
    at = f"{one.yaw}° " if one.yaw != "all" else ""
    caption = f"{one.rank}: {one.method}, {at}scene {one.scene}, frame {one.frame}, {one.ranked_by} {one.score:.4g}"
    return (
        f'<figure class="panel"{data}><figcaption>{escape(caption)}</figcaption><div class="over">{heads}</div>'
        f'<img loading="lazy" alt="{escape(caption)}" src="{url}"></figure>'
    )


def _failures(failures: Sequence[str]) -> str:
    lines = "".join(f"<li>{escape(line)}</li>" for line in failures)
    return f'<div class="failed"><p>These are missing from every mean; errors/ has the tracebacks.</p><ul>{lines}</ul></div>'


def _about(about: Mapping[str, Any]) -> str:
    rows = "\n".join(
        f'<tr><td class="word">{escape(name)}</td><td class="word"><code>{escape(text)}</code></td></tr>'
        for name, text in flattened(about)
        if name != "lead"
    )
    return f'<div class="scroll"><table>\n<tbody>\n{rows}\n</tbody>\n</table></div>'


def flattened(about: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """(`versions numpy`, `2.1`): nested mappings as lines."""
    for name, value in about.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{before}{name} ")
        else:
            text = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
            yield f"{before}{name}".replace("_", " "), text
