"""Removal from several frames of a scene: views with and without an object in; error behind it, by number of frames, out.

The object is masked in the first frame alone, whose mask is carried to the others, or in every frame. What was filled and is seen
again in another frame is held against what that frame shows there: they should be the same points.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from dlama.completion.pipeline import complete
from dlama.datasets.frames import RemovalTruth
from dlama.errors import DlamaError
from dlama.evaluation.metrics.depth import depth_errors
from dlama.evaluation.metrics.pictures import mse_map, region_mean
from dlama.evaluation.protocols.methods import Measure, ProtocolSettings
from dlama.evaluation.protocols.scores import perceptual
from dlama.evaluation.protocols.sequence import COUNTS, Row
from dlama.geometry.rendering import render
from dlama.geometry.view import Origin, View

REGION = "hidden"
"""What the object covers in the first frame."""
MASKS = {"one mask": False, "all masks": True}
"""Method -> whether the object is masked in every frame."""
SAME_SURFACE = 0.05
"""Relative depth up to which two frames show one filled point; beyond, something hides it in one of them."""
COLUMNS = ("filled %", "colour, levels", "MSE", "LPIPS", "depth MAE (m)", "AbsRel", "colours agree", "depths agree (%)")
METRICS = ("filled", "levels", "mse", "lpips", "mae", "absrel", "color_agrees", "depth_agrees")


def score_removal(
    views: Sequence[RemovalTruth], name: str, settings: ProtocolSettings, counts: Sequence[int] = COUNTS
) -> Iterator[Row]:
    """The numbers of the first view with 1, 2, ... frames: it, and those after it. A mask that cannot be carried gives no row."""
    truth = views[0]
    for count in counts:
        chosen = views[:count]
        if len(chosen) < count:
            return
        for method, everywhere in MASKS.items():
            if count == 1 and everywhere:
                continue
            masks = {number: one.mask for number, one in enumerate(chosen) if everywhere or number == 0}
            try:
                done = complete([one.source for one in chosen], [one.source.camera for one in chosen], mask=masks)
            except DlamaError:
                continue
            for measure in [*_errors(done.views[0], truth, settings), *agreement(done.views)]:
                yield Row(name, count, method, measure)


def _errors(view: View, truth: RemovalTruth, settings: ProtocolSettings) -> Iterator[Measure]:
    """Of what the object hid in the first frame."""
    region = truth.mask if truth.compare is None else truth.mask & truth.compare
    yield Measure(REGION, "rgb", "filled", 100 * float(view.filled[region].mean()))
    yield Measure(REGION, "rgb", "levels", float(np.abs(view.color.astype(float) - truth.without.color)[region].mean()))
    yield Measure(REGION, "rgb", "mse", region_mean(mse_map(truth.without.color, view.color), region))
    if settings.lpips:
        yield Measure(REGION, "rgb", "lpips", perceptual().region(view.color, truth.without.color, region))
    known = region & (truth.without.depth > 0)
    if known.any():
        errors = depth_errors(view.depth, truth.without.depth, known, settings.clip_m)
        for metric in ("mae", "absrel"):
            yield Measure(REGION, "depth_m", metric, errors[metric])


def agreement(views: Sequence[View]) -> Iterator[Measure]:
    """Filled points seen again in the next view: median difference of colour (levels) and of depth (%)."""
    colors, depths = [], []
    for view, other in pairwise(views):
        again = render(view, other.camera)
        both = (again.origin == Origin.FILLED) & other.filled & again.valid & other.valid
        apart = np.abs(again.depth[both] - other.depth[both]) / other.depth[both]
        same = apart < SAME_SURFACE
        colors.append(np.abs(again.color.astype(int) - other.color)[both][same].ravel())
        depths.append(apart[same])
    color, depth = (np.concatenate(parts) if parts else np.zeros(0) for parts in (colors, depths))
    if len(depth):
        yield Measure(REGION, "rgb", "color_agrees", float(np.median(color)))
        yield Measure(REGION, "depth_m", "depth_agrees", 100 * float(np.median(depth)))


def removal_table(rows: Sequence[Row]) -> str:
    """Means as a Markdown table: a line for each number of frames and way of masking."""
    digits = (0, 1, 0, 4, 4, 4, 1, 3)
    lines = [f"| frames | masks | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 2) + "|"]
    for count, method in dict.fromkeys((row.frames, row.method) for row in rows):
        cells = []
        for metric, digit in zip(METRICS, digits):
            values = [
                row.measure.value
                for row in rows
                if (row.frames, row.method, row.measure.metric) == (count, method, metric)
                and row.measure.region == REGION
            ]
            cells.append(f"{np.mean(values):.{digit}f}" if values else "-")
        lines.append(f"| {count} | {method} | {' | '.join(cells)} |")
    return "\n".join(lines)
