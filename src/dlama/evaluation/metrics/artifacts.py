"""The troubles that the paper names, as numbers: a completion and the truth in; measures out.

- Colour and depth are filled apart and drift: `edge_offset` px from each depth edge of the fill to the nearest colour
  edge (`edge_offset_truth`: the truth's own, for a true frame's colour edges do not all stand on depth edges either).
- Three equal depth channels come back unequal: `channel_spread`, mean of largest minus smallest, in grey levels.
- Points that should be hidden show through: `leaks`, % of what the warped view shows in the seen region.
- Filled depth hides what was measured: `law_violations` pixels by the method's own count, and `law_broken`, % of the
  filled pixels by the law as the uncut measurements lay it down (the paper's clip at 10 m puts fill before the sky).
"""

from __future__ import annotations

import numpy as np

from dlama.evaluation.protocols.methods import Measure
from dlama.evaluation.protocols.runs import Run
from dlama.geometry.rendering import inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law, violations

DEPTH_STEP = 0.1
"""Relative step in inverse depth between neighbours that makes a depth edge."""
COLOR_STEPS = (50, 150)
"""The two thresholds of Canny's edges, on 8-bit grey."""
FARTHEST_EDGE = 20.0
"""px; a depth edge without a colour edge within this distance counts as this far off."""
LEAK = 0.05
"""Relative depth by which a pixel must lie behind the truth to be a leak."""


def fill_troubles(
    run: Run, view: View, color: UInt8Array, region: BoolArray, name: str, truth: RGBD, source: RGBD | None = None
) -> list[Measure]:
    """What can be said of any fill; nothing of the baseline that fills nothing.

    Args:
        view: the completed one.
        color: its colours in the truth's exposure.
        region: H x W, the pixels whose edges are looked at; `name` is what it is called.
        source: what was measured; None leaves `law_broken` out.
    """
    if not run.fills:
        return []
    offsets = {
        "edge_offset": edge_offset(color, view.depth, region),
        "edge_offset_truth": edge_offset(truth.color, truth.depth, region),
    }
    found = [Measure(name, "depth", metric, value) for metric, value in offsets.items() if value is not None]
    return found + spread_measures(run) + law_measures(run, view, source)


def edge_offset(color: UInt8Array, depth: Float32Array, region: BoolArray) -> float | None:
    """Mean distance in px from the depth edges in a region to the nearest colour edge; None: no depth edge there."""
    import cv2

    steps = depth_edges(depth) & region
    if not steps.any():
        return None
    edges = cv2.Canny(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), *COLOR_STEPS) > 0
    if not edges.any():
        return FARTHEST_EDGE
    away = cv2.distanceTransform((~edges).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return float(np.minimum(away[steps], FARTHEST_EDGE).mean())


def depth_edges(depth: Float32Array) -> BoolArray:
    """H x W, True at the nearer pixel of two neighbours whose depths part; far counts, missing says nothing."""
    w = np.where(depth > 0, inverse_depth(depth), np.nan)
    edges = np.zeros(depth.shape, np.bool_)
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        one, other = w[here], w[there]
        with np.errstate(invalid="ignore"):
            edges[here] |= one > other * (1 + DEPTH_STEP)
            edges[there] |= other > one * (1 + DEPTH_STEP)
    return edges


def spread_measures(run: Run) -> list[Measure]:
    """How far the depth channels of a three-channel filler came apart, where it says so."""
    spread = run.completion.meta.get("notes", {}).get("depth_channel_spread")
    return [] if spread is None else [Measure("whole", "depth", "channel_spread", float(spread))]


def law_measures(run: Run, view: View, source: RGBD | None) -> list[Measure]:
    """Violations of the visibility law, by the method's own count and by the uncut measurements."""
    own = Measure("whole", "depth_m", "law_violations", float(run.completion.meta["law_violations"]))
    filled = int(view.filled.sum())
    if source is None or not filled:
        return [own]
    broken = int(violations(view, Law.of(Scene((View.from_rgbd(source),)))).sum())
    return [own, Measure("whole", "depth_m", "law_broken", 100 * broken / filled)]


def leaks(warped: View, truth: RGBD, seen: BoolArray, clip_m: float | None = None) -> list[Measure]:
    """% of the seen region's pixels, shown in the view before filling, that lie behind the truth: what should be hidden.

    Depths are cut at `clip_m`, so that the recipe which clips is judged by what it claims to show.
    """
    limit = np.float32(np.inf if clip_m is None else clip_m)
    shown = seen & ~warped.hole & (truth.depth > 0)
    if not shown.any():
        return []
    there, mine = np.minimum(truth.depth[shown], limit), np.minimum(warped.depth[shown], limit)
    return [Measure("seen", "depth_m", "leaks", 100 * float((mine > there * np.float32(1 + LEAK)).mean()))]
