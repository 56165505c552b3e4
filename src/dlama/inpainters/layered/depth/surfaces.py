"""Surface continuation: a view's known surfaces in; inverse depth and a surface label for every hole pixel out.

Ground and walls continue as planes, the sky as sky; anything else is interpolated from the far side of the hole.
`surface_labels` decides on a coarse grid which surface continues where. Where depth alone is missing, colours decide
(`missing_depth`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.holes import fill_with_nearest, shrink_mask
from dlama.geometry.kernels.jit import begin_job
from dlama.geometry.projection import depth_from_inverse, inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.layered.depth.cut_objects import find_cut_objects
from dlama.inpainters.layered.depth.foliage import copy_leaves
from dlama.inpainters.layered.depth.out_of_view import FOLLOWED, cells_near
from dlama.inpainters.layered.depth.surface_labels import GRID, LEEWAY, CoarseView
from dlama.inpainters.layered.kernels import surfaces as surface_kernels
from dlama.perception.missing_depth import fill_along_colors, find_known_surfaces, move_beyond_range
from dlama.perception.planes import SMOOTH, KnownSurfaces, plane_values, plane_values_at
from dlama.perception.resampling import interpolate

PIECE = 1 << 16
"""Hole pixels that are worked on at a time."""


@dataclass(frozen=True, eq=False)
class Surfaces(KnownSurfaces):
    """The surfaces of a view, continued into its holes: inverse depth and label of every pixel."""

    leaves: NDArray[np.intp] = field(default_factory=lambda: np.zeros((2, 0), np.intp))
    """2 x N, as of `copy_leaves`: where foliage extends."""

    def cropped(self, rows: slice, columns: slice) -> Surfaces:
        """Those of a part of the view (`View.cropped`) that foliage does not extend into."""
        a, b, c = self.planes.T
        planes = np.stack([a, b, c + a * columns.start + b * rows.start], 1)
        part = np.s_[rows, columns]
        return Surfaces(self.inverse_depth[part].copy(), self.label[part].copy(), planes)

    def without_leaves(self, where: BoolArray) -> BoolArray:
        """`where` (H x W) without the pixels that foliage extends into."""
        out = where.copy()
        out.ravel()[self.leaves[0]] = False
        return out


def continue_lawfully(view: View, context: FillContext, seed: int) -> tuple[Surfaces, Float32Array, int]:
    """The surfaces continued into the holes, their depth projected onto the visibility law, and how many pixels that moved."""
    surfaces, hole = continue_surfaces(view, context, seed), view.hole
    depth, moved = context.law.project(view.camera, depth_from_inverse(surfaces.inverse_depth), hole)
    surfaces.inverse_depth[hole] = inverse_depth(depth[hole])
    return surfaces, depth, int(moved.sum())


def continue_surfaces(view: View, context: FillContext, seed: int = 0) -> Surfaces:
    """The known surfaces of a view, continued into its holes; the same seed finds the same planes."""
    missing = view.depth_hole
    known, sky = find_known_surfaces(view.color, view.known_depth, missing, seed)
    if missing.any():

        def is_lawful(w: Float32Array, where: BoolArray) -> BoolArray:
            return where & ~context.law.violations(view.camera, LEEWAY * depth_from_inverse(w), where)

        along_colors = fill_along_colors(view.color, missing, view.hole, known, sky, is_lawful)
        by_color = move_beyond_range(along_colors, known.inverse_depth, missing, view.hole)
        known = dataclasses.replace(known, inverse_depth=by_color.inverse_depth, label=by_color.label)
        if (by_color.reached | ~view.hole).all():
            return Surfaces(**vars(known))
        # of a LIDAR, whose readings are single, hardly a cell would be known without
        view = view.with_known_depth(depth_from_inverse(known.inverse_depth), by_color.reached)
    coarse = sample_grid(view, known, max(1.0, max(missing.shape) / GRID), context.law.misplaced_edges)
    leaves = begin_job(copy_leaves, view, known.inverse_depth, coarse.cut, seed)
    return upsample_labels(view, known, coarse, coarse.label_costs(context), leaves, context.law)


def sample_grid(view: View, surfaces: KnownSurfaces, step: float, solid: bool = False) -> CoarseView:
    """The grid of a view, of cells `step` pixels wide. Planes of noisy depth are not followed; solid: see `CoarseView`."""
    camera = view.camera.with_larger_pixels(step)
    rows, columns = (
        np.minimum(((np.arange(n) + 0.5) * step).astype(np.int64), size - 1)
        for n, size in zip(camera.hw, view.hole.shape)
    )
    pick = np.ix_(rows, columns)
    # a cell that a hole touches is one: a hole one pixel wide must not be missed
    hole, w, label = shrink_mask(view.hole, camera.wh) > 0, surfaces.inverse_depth[pick], surfaces.label[pick]
    in_view = hole & (shrink_mask(view.hole & (view.hole_type != HoleType.OUT_OF_VIEW.value), camera.wh) > 0)
    with_leaves = Origin.ESTIMATED not in view.origins  # estimates are smooth: their steps are errors
    cut = begin_job(partial(find_cut_objects, with_leaves=with_leaves), w, label, hole, cells_near(hole & ~in_view))
    smooth = surface_kernels.far_side(w, hole)
    candidates = np.concatenate(
        [smooth[None], np.zeros_like(smooth)[None], plane_values(surfaces.planes, camera.hw, step)]
    )
    followed_from = np.inf if surfaces.noise else FOLLOWED
    removed = (shrink_mask(view.object_hole, camera.wh) > 0) & hole
    return CoarseView(camera, hole, in_view, w, label, candidates, cut(), followed_from, solid, removed)


def upsample_labels(
    view: View,
    known: KnownSurfaces,
    coarse: CoarseView,
    costs: Float32Array,
    leaves_of: Callable[[], NDArray[np.intp]],
    law: Law,
) -> Surfaces:
    """Label costs (h x w x L) interpolated to every hole pixel; each takes the label of least cost and its inverse depth.
    Foliage covers it where it extends and `law` has room for it: an object seen whole is not cut, wherever its background ends.
    known: its planes of pixels are taken over; leaves_of: gives `copy_leaves`.
    """
    places, hw = np.flatnonzero(view.hole), view.hole.shape
    spread = fill_with_nearest(costs, coarse.hole)
    no_plane = coarse.candidates[0]
    filled = interpolate(fill_with_nearest(no_plane, coarse.hole & (no_plane > 0)), hw).take(places)
    best, labels = np.full(len(places), np.inf, np.float32), np.full(len(places), SMOOTH, np.int8)
    for number in range(costs.shape[2]):
        cost = interpolate(spread[..., number], hw).take(places)
        np.copyto(labels, np.int8(number - 1), where=cost < best)
        np.minimum(best, cost, out=best)
    for first in range(0, len(places), PIECE):
        some = slice(first, first + PIECE)
        on_plane = plane_values_at(known.planes, labels[some], *np.divmod(places[some], hw[1]))
        on_plane = np.where(labels[some] > 0, np.maximum(0, on_plane), 0)
        filled[some] = np.where(labels[some] == SMOOTH, filled[some], on_plane)
    out, label = known.inverse_depth.ravel(), known.label.ravel()
    out[places], label[places] = filled, labels
    pixels, leaves = leaves_of()
    nearer = out[leaves] > out[pixels]
    pixels, leaves = pixels[nearer], leaves[nearer]
    lawful = ~law.violations_at(view.camera, pixels, depth_from_inverse(out[leaves]))
    pixels, leaves = pixels[lawful], leaves[lawful]
    out[pixels], label[pixels] = out[leaves], SMOOTH
    return Surfaces(**vars(known), leaves=np.stack([pixels, leaves]))
