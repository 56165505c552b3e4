"""A completed view in; a layer that continues each surface under the nearer one that it meets at a depth edge, out.

Rendering cuts surfaces at depth edges. Seen from a little aside such a cut opens by a pixel or a few: what is filled for some
cameras leaves slivers for those between them. The layer lies behind everything, and closes them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.drawing.grid_mesh import mesh_grid
from dlama.geometry.holes import nearest_known
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.projection import depth_from_inverse, inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, replace_pixels
from dlama.geometry.view import View

BEHIND = np.float32(0.98)
"""Of its inverse depth, by which the layer lies behind what it continues: it shows where nothing else does."""
STEPS = ((0, 1), (0, -1), (1, 0), (-1, 0))
"""Rows and columns to the neighbours: to the right, left, down and up."""


def continue_under_edges(view: View, reach: int, least: float = 0.0) -> tuple[View, BoolArray]:
    """The view with the surfaces behind its depth edges continued by `reach` px under the nearer ones, at the depth and in the
    colour of their last pixels; and H x W, True at these pixels, which are FILLED. Holes take the nearest pixel's depth before.
    least: step in inverse depth (1/m) up to which neighbours are one surface.
    """
    depth, joined = mesh_grid(view, least)
    depth = np.where(view.far, np.float32(np.inf), depth)
    if not (depth > 0).any():
        return view, np.zeros(depth.shape, bool)
    nearest = nearest_known(depth > 0)[1]
    w = inverse_depth(depth.ravel()[nearest])
    right, down = ((joined & bit) == 0 for bit in (RIGHT, DOWN))
    cuts = right, shift_plane(right, (0, -1), False), down, shift_plane(down, (-1, 0), False)
    behind, source = spread(w, nearest, w, np.full(w.shape, np.inf, np.float32), cuts)
    for _ in range(reach - 1):
        behind, source = spread(behind, source, w, behind)
    added = np.isfinite(behind)
    return lay_behind(view, added, behind, source), added


def continue_everywhere(view: View, reach: int) -> View:
    """The farthest surface within `reach` px of each pixel of the view, a little behind itself and FILLED: nothing of the view
    lies behind it. Holes take the nearest pixel before. Of a view without any depth, the view."""
    if view.hole.all():
        return view
    source = nearest_known(~view.hole)[1]
    w = behind = inverse_depth(view.depth.ravel()[source])
    for _ in range(reach):
        behind, source = spread(behind, source, w, behind)
    return lay_behind(view, np.ones_like(view.hole), behind, source)


def lay_behind(view: View, added: BoolArray, w: Float32Array, source: NDArray[np.intp]) -> View:
    """The view with other pixels where `added` (H x W), FILLED: a little behind an inverse depth (1/m), in the colours of the
    pixels `source` (H x W flat indices)."""
    return view.with_planes(
        color=replace_pixels(view.color, added, view.color.reshape(-1, 3)[source]),
        depth=np.where(added, depth_from_inverse(np.where(added, w * BEHIND, 1)), view.depth),
        hole=view.hole & ~added,
        hole_type=np.where(added, np.uint8(HoleType.DISOCCLUDED), np.uint8(HoleType.NONE)),
        origin=np.where(added, np.uint8(Origin.FILLED), view.origin),
        confidence=np.where(added, np.float32(0.2), view.confidence),
        errors=None,
    )


def shift_plane(plane: np.ndarray, step: tuple[int, int], outside: float) -> np.ndarray:
    """H x W: of each pixel the value of the neighbour at a step (rows, columns); beyond the border `outside`."""
    (rows, columns), (down, right) = plane.shape, step
    return np.pad(plane, 1, constant_values=outside)[1 + down : 1 + down + rows, 1 + right : 1 + right + columns]


def spread(
    farther: Float32Array,
    source: NDArray[np.intp],
    w: Float32Array,
    found: Float32Array,
    cuts: Sequence[BoolArray | bool] = (True,) * len(STEPS),
) -> tuple[Float32Array, NDArray[np.intp]]:
    """H x W: inverse depth (1/m, +inf where there is none) of what continues from a neighbour under a pixel, behind what is seen
    there (w) and what was `found` for it; and which pixel (flat index) it continues.

    farther: of each pixel what may continue; source: the pixel that it continues; cuts: H x W, for each of STEPS where there is
    an edge.
    """
    continued = source
    for step, cut in zip(STEPS, cuts):
        other = shift_plane(farther, step, np.inf)
        better = cut & (other < w * BEHIND) & (other < found)
        found = np.where(better, other, found)
        continued = np.where(better, shift_plane(source, step, 0), continued)
    return found, continued
