"""A completed view in; a layer that continues each surface under the nearer one that it meets at a depth edge, out.

Rendering cuts surfaces at depth edges. Seen from a little aside such a cut opens by a pixel or a few: what is filled for some
cameras leaves slivers for those between them. The layer lies behind everything, and closes them.
"""

from __future__ import annotations

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
CONFIDENCE = np.float32(0.2)
STEPS = ((0, 1), (0, -1), (1, 0), (-1, 0))


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
    behind, source = find_seeds(w, joined, nearest)
    for _ in range(reach - 1):
        behind, source = spread(behind, source, w)
    added = np.isfinite(behind)
    color = view.color.reshape(-1, 3)[source]
    layer = view.with_planes(
        color=replace_pixels(view.color, added, color),
        depth=np.where(added, depth_from_inverse(np.where(added, behind * BEHIND, 1)), view.depth),
        hole=view.hole & ~added,
        hole_type=np.where(added, np.uint8(HoleType.DISOCCLUDED), np.uint8(HoleType.NONE)),
        origin=np.where(added, np.uint8(Origin.FILLED), view.origin),
        confidence=np.where(added, CONFIDENCE, view.confidence),
        errors=None,
    )
    return layer, added


def shift_plane(plane: np.ndarray, step: tuple[int, int], outside: float) -> np.ndarray:
    """H x W: of each pixel the value of the one a step (rows, columns) away; beyond the border `outside`."""
    out = np.full_like(plane, outside)
    to, of = (
        [slice(max(0, -d), n - max(0, d)) for d, n in zip(way, plane.shape)] for way in (step, [-d for d in step])
    )
    out[tuple(to)] = plane[tuple(of)]
    return out


def find_seeds(w: Float32Array, joined: np.ndarray, source: NDArray[np.intp]) -> tuple[Float32Array, NDArray[np.intp]]:
    """H x W: inverse depth (1/m) of what continues under the pixels on the near side of a depth edge, elsewhere +inf; and which
    pixel (flat index) it continues. source: of each pixel of `w` the one that it was read from."""
    behind, continued = np.full(w.shape, np.inf, np.float32), source
    for (down, right), bit in (((0, 1), RIGHT), ((1, 0), DOWN)):
        apart = (joined & bit) == 0
        for step, cut in (((down, right), apart), ((-down, -right), shift_plane(apart, (-down, -right), False))):
            other = shift_plane(w, step, np.inf)
            better = cut & (other < w * BEHIND) & (other < behind)
            behind = np.where(better, other, behind)
            continued = np.where(better, shift_plane(source, step, 0), continued)
    return behind, continued


def spread(behind: Float32Array, source: NDArray[np.intp], w: Float32Array) -> tuple[Float32Array, NDArray[np.intp]]:
    """The same one pixel further, where it stays behind what is seen (w)."""
    found, from_where = behind, source
    for step in STEPS:
        other = shift_plane(behind, step, np.inf)
        better = (other < w * BEHIND) & (other < found)
        found = np.where(better, other, found)
        from_where = np.where(better, shift_plane(source, step, 0), from_where)
    return found, from_where
