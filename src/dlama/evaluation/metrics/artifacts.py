"""Filled colour and depth and the truth in; numbers for the artifacts that the paper names out.

- Colour and depth are filled independently and drift apart: `edge_offset`, px from each depth edge of the fill to the nearest
  colour edge (`edge_offset_truth`: the same of the truth, where not every depth edge has a colour edge either).
- Three equal depth channels come back unequal: `channel_spread`, mean of largest minus smallest, in grey levels.
- Points that should be hidden show through: `leaks`, % of what the warped view shows in the seen region.
- Filled depth hides what was measured: `law_violations`, pixels by the method's own count, and `law_broken`, % of the
  filled pixels by the law of the uncut measurements (the paper's clip at 10 m puts filled depth in front of the sky).

`channel_spread` and `law_violations` are counted while filling; the others are measured here.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.projection import inverse_depth
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


def edge_offset(color: UInt8Array, depth: Float32Array, region: BoolArray) -> float | None:
    """Mean distance from the depth edges in a region to the nearest colour edge.

    Args:
        color: H x W x 3.
        depth: H x W metres; 0 = missing, inf = far.
        region: H x W.
    Returns:
        px, 0..FARTHEST_EDGE; None where the region has no depth edge.
    """
    steps = depth_edges(depth) & region
    if not steps.any():
        return None
    edges = cv2.Canny(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), *COLOR_STEPS) > 0
    if not edges.any():
        return FARTHEST_EDGE
    away = cv2.distanceTransform((~edges).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return float(np.minimum(away[steps], FARTHEST_EDGE).mean())


def depth_edges(depth: Float32Array) -> BoolArray:
    """H x W, True at the nearer of two neighbours that differ by DEPTH_STEP or more; far counts, missing does not."""
    w = np.where(depth > 0, inverse_depth(depth), np.nan)
    edges = np.zeros(depth.shape, np.bool_)
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        one, other = w[here], w[there]
        with np.errstate(invalid="ignore"):
            edges[here] |= one > other * (1 + DEPTH_STEP)
            edges[there] |= other > one * (1 + DEPTH_STEP)
    return edges


def law_broken(view: View, source: RGBD) -> float | None:
    """% of a view's filled pixels that break the visibility law of the source's uncut measurements; None: none is filled."""
    filled = int(view.filled.sum())
    if not filled:
        return None
    return 100 * int(violations(view, Law.of(Scene((View.from_rgbd(source),)))).sum()) / filled


def leak_share(warped: View, truth: RGBD, seen: BoolArray, clip_m: float | None = None) -> float | None:
    """Share of what the view before filling shows in the seen region that lies behind the truth, so should be hidden.

    Args:
        warped: the view before filling.
        truth: of the same camera.
        seen: H x W, the region.
        clip_m: metres at which both depths are cut, so that a recipe that clips is judged by what it claims to show.
    Returns:
        %, 0..100; None where nothing is shown.
    """
    limit = np.float32(np.inf if clip_m is None else clip_m)
    shown = seen & ~warped.hole & (truth.depth > 0)
    if not shown.any():
        return None
    there, mine = np.minimum(truth.depth[shown], limit), np.minimum(warped.depth[shown], limit)
    return 100 * float((mine > there * np.float32(1 + LEAK)).mean())
