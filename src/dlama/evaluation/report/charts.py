"""A Summary in; figures as SVG elements of a page out: curves over yaw with intervals, and shares against shares."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from dlama.errors import import_extra
from dlama.evaluation.report.columns import PAPER, Which, better_direction, column_title, paper_value
from dlama.evaluation.report.summary import Mean, Place

INK = "#0a0b0c"
"""What is drawn in this colour takes the colour of the page's text."""
OTHER = "#8a8f98"
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#9a6324", "#7f7f7f")
"""Okabe and Ito's colours, which people with colour blindness can distinguish, visible on white and on black; one a filler."""
LINES = ("-", "--", ":", "-.")
"""One a recipe."""
MARKS = ("o", "s", "^", "D")
PAPER_STYLE: Any = {"color": OTHER, "linestyle": (0, (1, 2)), "marker": "x", "markersize": 4, "linewidth": 1.2}
SETTINGS: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "dlama",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "grid.color": OTHER,
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), INK),
}
PLOT_INCHES = (3.4, 2.4)
"""Width and height of a plot over yaw."""


@dataclass(frozen=True)
class Figure:
    """Small plots side by side, as SVG elements: one a metric."""

    caption: str
    plots: tuple[str, ...]
    legend: tuple[tuple[str, str], ...]
    """(SVG of a line's sample, what the line is)."""
    has_intervals: bool = True
    """False where there is one scene: nothing is drawn round the means."""


def curves(place: Place, chosen: Sequence[Which], methods: Sequence[str], caption: str) -> Figure | None:
    """Each metric over yaw: a line a method with its 95 % interval as a band, the paper's numbers in grey.

    Returns:
        None where there are fewer than two yaws, or nothing was measured.
    """
    yaws = [one for one in place.values("yaw") if one[0] in "±≈0"]
    drawn = [which for which in chosen if any(place.mean(y, m, which) for y in yaws for m in methods)]
    if len(yaws) < 2 or not drawn:
        return None
    plots = [
        _svg(_plot(place, which, methods, yaws), f"{caption}: {_heading(which)}", (*place[1:], caption))
        for which in drawn
    ]
    with_paper = any(_paper_values(yaws, which) for which in drawn)
    legend = _legend(methods, with_paper, (*place[1:], caption))
    has_intervals = any(one.low is not None for one in place.of().values())
    return Figure(caption, tuple(plots), legend, has_intervals)


def _plot(place: Place, which: Which, methods: Sequence[str], yaws: Sequence[str]) -> Any:
    sheet, axes = _sheet(*PLOT_INCHES)
    for method in methods:
        found = [(_degrees(yaw), place.mean(yaw, method, which)) for yaw in yaws]
        _curve(axes, [(x, mean) for x, mean in found if mean is not None], _style(methods, method))
    if published := _paper_values(yaws, which):
        axes.plot(*zip(*published), **PAPER_STYLE)
    axes.set_xticks([_degrees(yaw) for yaw in yaws], yaws)
    axes.set_title(_heading(which), fontsize=9)
    return sheet


def against_diagonal(
    lines: dict[str, list[tuple[float, float]]], axis_names: tuple[str, str], caption: str, place: tuple[str, ...]
) -> Figure:
    """Shares (0..1) against shares: a line a method through its points, and the diagonal on which both are equal."""
    sheet, axes = _sheet(PLOT_INCHES[0], PLOT_INCHES[0])
    axes.plot([0, 1], [0, 1], color=OTHER, linewidth=0.8)
    for method, points in lines.items():
        if points:
            axes.plot(*zip(*points), markersize=3.5, linewidth=1.4, **_style(list(lines), method))
    axes.set_xlabel(axis_names[0])
    axes.set_ylabel(axis_names[1])
    axes.set_aspect("equal")
    plot = _svg(sheet, f"{caption}: {axis_names[1]} by {axis_names[0]}", (*place, caption))
    return Figure(caption, (plot,), _legend(list(lines), False, (*place, caption)), has_intervals=False)


def _curve(axes: Any, found: Sequence[tuple[float, Mean]], style: dict[str, Any]) -> None:
    """Means by degrees of yaw."""
    if not found:
        return
    across = [degrees for degrees, _ in found]
    axes.plot(across, [mean.value for _, mean in found], markersize=3.5, linewidth=1.4, **style)
    band = [(x, mean.low, mean.high) for x, mean in found if mean.low is not None]
    if band:
        axes.fill_between(*map(list, zip(*band)), color=style["color"], alpha=0.10, linewidth=0)


def _paper_values(yaws: Sequence[str], which: Which) -> list[tuple[float, float]]:
    """(degrees, the paper's number) where it has one."""
    published = [paper_value(yaw, *which) for yaw in yaws]
    return [(_degrees(yaw), value) for yaw, value in zip(yaws, published) if value is not None]


def _legend(methods: Sequence[str], with_paper: bool, place: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """A sample of each line."""
    styles = [(method, _style(methods, method)) for method in methods] + ([(PAPER, PAPER_STYLE)] if with_paper else [])
    samples = []
    for name, style in styles:
        sheet, axes = _sheet(0.5, 0.16)
        axes.set_axis_off()
        axes.plot([0, 1, 2], [0, 0, 0], markevery=[1], **({"markersize": 3.5, "linewidth": 1.4} | style))
        samples.append((_svg(sheet, f"line of {name}", place), name))
    return tuple(samples)


def _style(methods: Sequence[str], method: str) -> dict[str, Any]:
    """A colour a filler, a line and a mark a recipe."""
    recipe, _, filler = method.rpartition("/")
    recipes = list(dict.fromkeys(one.rpartition("/")[0] for one in methods))
    fillers = list(dict.fromkeys(one.rpartition("/")[2] for one in methods))
    kind = recipes.index(recipe)
    return {
        "color": PALETTE[fillers.index(filler) % len(PALETTE)],
        "linestyle": LINES[kind % len(LINES)],
        "marker": MARKS[kind % len(MARKS)],
    }


def _heading(which: Which) -> str:
    """The metric, and an arrow to its good side."""
    return f"{column_title(*which)}{ {1: ' ↑', -1: ' ↓', 0: ''}[better_direction(which[2])] }"


def _degrees(yaw: str) -> float:
    return float(re.sub(r"[^\d.]", "", yaw))


def _sheet(width: float, height: float) -> tuple[Any, Any]:
    """A figure of so many inches, and its axes."""
    with _matplotlib().rc_context(SETTINGS):
        sheet = _matplotlib("matplotlib.figure").Figure(figsize=(width, height), layout="constrained")
        return sheet, sheet.subplots()


def _matplotlib(module: str = "matplotlib") -> Any:
    return import_extra(module, "the report", "matplotlib", "evaluate")


def _svg(sheet: Any, label: str, place: tuple[str, ...]) -> str:
    """A plot as an element; `place` (protocol, data set, caption) makes the ids of equal plots differ."""
    stream = io.StringIO()
    with _matplotlib().rc_context(SETTINGS):
        sheet.savefig(stream, format="svg", transparent=True, metadata={"Date": None})
    return inline(stream.getvalue(), label, place)


def inline(svg: str, label: str, place: tuple[str, ...] = ()) -> str:
    """The <svg> element alone: labelled for screen readers, ids unique in the page, INK replaced by the colour of its text."""
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    mark = "f" + hashlib.sha256("\0".join((*place, label, svg)).encode()).hexdigest()[:8]
    svg = re.sub(r'\bid="', f'id="{mark}-', svg)
    svg = re.sub(r"url\(#", f"url(#{mark}-", svg)
    svg = re.sub(r'(xlink:)?href="#', f'href="#{mark}-', svg)
    svg = svg.replace(INK, "currentColor")
    body = svg[svg.index(">") + 1 :]
    box = re.search(r'viewBox="([^"]*)"', svg)
    assert box is not None
    return f'<svg viewBox="{box[1]}" role="img" aria-label="{escape(label)}">{body}'.strip()
