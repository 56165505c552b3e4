"""A Summary in, figures out as SVG that stands inside a page: curves over yaw with intervals, dots per method."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Sequence
from typing import Any

from dlama.errors import MissingExtraError
from dlama.evaluation.report.metric_names import MASK_RATIO, Which, better, titled
from dlama.evaluation.report.paper_columns import MASK_RATIO as PAPER_MASK_RATIO
from dlama.evaluation.report.paper_columns import PAPER, paper_value
from dlama.evaluation.report.summary import ALL, Key, Summary

INK = "#0a0b0c"
"""What is drawn in this colour takes the colour of the page's text."""
OTHER = "#8a8f98"
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#9a6324", "#7f7f7f")
"""Okabe and Ito's colours, which the colour-blind tell apart and which show on white and on black; one a filler."""
LINES = ("-", "--", ":", "-.")
"""One a recipe."""
MARKS = ("o", "s", "^", "D")
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
COLUMNS = 3


def curves(
    summary: Summary, protocol: str, dataset: str, chosen: Sequence[Which], methods: Sequence[str], title: str
) -> str | None:
    """Each metric over yaw, a line a method with its interval as a band, the paper's numbers in grey; None without yaws."""
    yaws = [one for one in summary.values("yaw", protocol=protocol, dataset=dataset) if one[0] in "±≈0"]
    drawn = [
        which for which in chosen if any(Key(protocol, dataset, yaws[0], m, *which) in summary.means for m in methods)
    ]
    if len(yaws) < 2 or not drawn:
        return None
    figure, places = _sheet(len(drawn), height=2.5)
    for axes, which in zip(places, drawn):
        for method in methods:
            _curve(
                axes, summary, [Key(protocol, dataset, yaw, method, *which) for yaw in yaws], _style(methods, method)
            )
        _paper_curve(axes, yaws, which)
        axes.set_title(_heading(which), fontsize=9)
        axes.set_xticks([_degrees(yaw) for yaw in yaws], yaws)
    return _as_svg(figure, places, len(drawn), title)


def dots(
    summary: Summary, protocol: str, dataset: str, chosen: Sequence[Which], methods: Sequence[str], title: str
) -> str | None:
    """Each metric over all frames, a dot a method with its interval; None where there is nothing to draw."""
    drawn = [
        which for which in chosen if any(Key(protocol, dataset, ALL, one, *which) in summary.means for one in methods)
    ]
    if not drawn:
        return None
    figure, places = _sheet(len(drawn), height=0.6 + 0.22 * len(methods))
    for number, (axes, which) in enumerate(zip(places, drawn)):
        for down, method in enumerate(methods):
            _dot(axes, summary, Key(protocol, dataset, ALL, method, *which), down, _style(methods, method))
        axes.set_title(_heading(which), fontsize=9)
        axes.set_yticks(range(len(methods)), methods if number % COLUMNS == 0 else [""] * len(methods))
        axes.set_ylim(len(methods) - 0.5, -0.5)
        axes.margins(x=0.08)
        axes.locator_params(axis="x", nbins=4)
        axes.ticklabel_format(axis="x", useOffset=False)
    return _as_svg(figure, places, len(drawn), title, legend=False)


def _curve(axes: Any, summary: Summary, keys: Sequence[Key], style: dict[str, Any]) -> None:
    found = [(_degrees(key.yaw), summary.means[key]) for key in keys if key in summary.means]
    if not found:
        return
    across = [degrees for degrees, _ in found]
    axes.plot(across, [mean.value for _, mean in found], markersize=3.5, linewidth=1.4, **style)
    band = [(x, mean.low, mean.high) for x, mean in found if mean.low is not None]
    if band:
        axes.fill_between(*map(list, zip(*band)), color=style["color"], alpha=0.10, linewidth=0)


def _dot(axes: Any, summary: Summary, key: Key, down: int, style: dict[str, Any]) -> None:
    mean = summary.means.get(key)
    if mean is None or abs(mean.value) == float("inf"):
        return
    axes.plot([mean.value], [down], color=style["color"], marker=style["marker"], markersize=5, linestyle="none")
    if mean.low is not None:
        axes.plot([mean.low, mean.high], [down, down], color=style["color"], linewidth=1.4)


def _paper_curve(axes: Any, yaws: Sequence[str], which: Which) -> None:
    beside = [PAPER_MASK_RATIO.get(yaw) if which == MASK_RATIO else paper_value(yaw, *which) for yaw in yaws]
    found = [(_degrees(yaw), value) for yaw, value in zip(yaws, beside) if value is not None]
    if found:
        axes.plot(
            *zip(*found), color=OTHER, linestyle=(0, (1, 2)), marker="x", markersize=4, linewidth=1.2, label=PAPER
        )


def _style(methods: Sequence[str], method: str) -> dict[str, Any]:
    """A colour a filler, a line and a mark a recipe: what differs in one of them is told apart at a glance."""
    recipe, _, filler = method.rpartition("/")
    recipes = list(dict.fromkeys(one.rpartition("/")[0] for one in methods))
    fillers = list(dict.fromkeys(one.rpartition("/")[2] for one in methods))
    kind = recipes.index(recipe)
    return {
        "color": PALETTE[fillers.index(filler) % len(PALETTE)],
        "linestyle": LINES[kind % len(LINES)],
        "marker": MARKS[kind % len(MARKS)],
        "label": method,
    }


def _heading(which: Which) -> str:
    """The metric, and an arrow to its good side."""
    name = f"{'mask ratio, %' if which == MASK_RATIO else titled(*which)}"
    return f"{name}{ {1: ' ↑', -1: ' ↓', 0: ''}[better(which[2])] }"


def _degrees(yaw: str) -> float:
    return float(re.sub(r"[^\d.]", "", yaw))


def _sheet(count: int, height: float) -> tuple[Any, list[Any]]:
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("the report", "matplotlib", "evaluate") from error
    across = min(count, COLUMNS)
    down = -(-count // COLUMNS)
    with rc_context(SETTINGS):
        figure = Figure(
            figsize=(3.4 * across + (0.9 if across < COLUMNS else 0), height * down + 0.5), layout="constrained"
        )
        return figure, list(figure.subplots(down, across, squeeze=False).flat)


def _as_svg(figure: Any, places: Sequence[Any], used: int, title: str, legend: bool = True) -> str:
    from matplotlib import rc_context

    for axes in places[used:]:
        axes.set_visible(False)
    with rc_context(SETTINGS):
        if legend:
            handles = {name: line for axes in places for line, name in zip(*axes.get_legend_handles_labels())}
            figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, frameon=False)
        stream = io.StringIO()
        figure.savefig(stream, format="svg", transparent=True, metadata={"Date": None})
    return inline(stream.getvalue(), title)


def inline(svg: str, title: str) -> str:
    """The <svg> element alone, named for those who cannot see it, its ids its own, its ink the page's."""
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    mark = "f" + hashlib.sha256(svg.encode()).hexdigest()[:8]
    svg = re.sub(r'\bid="', f'id="{mark}-', svg)
    svg = re.sub(r"url\(#", f"url(#{mark}-", svg)
    svg = re.sub(r'(xlink:)?href="#', f'href="#{mark}-', svg)
    svg = svg.replace(INK, "currentColor")
    svg = re.sub(
        r'<svg [^>]*?viewBox="([^"]*)"[^>]*>', rf'<svg viewBox="\1" role="img" aria-label="{title}">', svg, count=1
    )
    return svg.strip()
