"""The name of a template in; the template, of which pages are made that load nothing else, out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dlama.errors import import_extra

PARTS = Path(__file__).parents[2] / "assets" / "report"
"""base.html and what is made of it: page.html (an evaluation) and batch.html; their parts, style.css and script.js;
summary.md."""


def template(name: str, extra: str) -> Any:
    """A template of Jinja2, which in pages escapes what is not marked as HTML. MissingExtraError: Jinja2 is not installed."""
    jinja = import_extra("jinja2", "the report", "jinja2", extra)
    made = jinja.Environment(
        loader=jinja.FileSystemLoader(PARTS),
        autoescape=jinja.select_autoescape(["html"]),
        undefined=jinja.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals["part"] = lambda name: (PARTS / name).read_text(encoding="utf-8").strip()
    return made.get_template(name)
