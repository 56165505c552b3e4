"""Surface continuation: a view's known surfaces in; inverse depth and a surface label for every hole pixel out.

Ground and walls continue as planes, the sky as sky; anything else is interpolated from the far side of the hole.
`surface_labels` decides which surface continues where. Where depth alone is missing, colours decide
(`missing_depth`).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.geometry.kernels.jit import begin_job
from dlama.geometry.projection import depth_from_inverse, inverse_depth
from dlama.geometry.rgbd import Float32Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.layered.depth.foliage import copy_leaves
from dlama.inpainters.layered.depth.surface_labels import GRID, OFF_SURFACE, CoarseView, Surfaces, upsample_labels
from dlama.inpainters.missing_depth.along_colors import DepthByColor, fill_along_colors
from dlama.perception.planes import KnownSurfaces


def continue_lawfully(view: View, context: FillContext, seed: int) -> tuple[Surfaces, Float32Array, int]:
    """The surfaces continued into the holes, their depth projected onto the visibility law, and how many pixels that moved."""
    surfaces, hole = continue_surfaces(view, context, seed), view.hole
    w, off_surface = surfaces.inverse_depth, np.zeros(hole.shape, np.bool_)
    depth, moved = context.law.project(view.camera, depth_from_inverse(w), hole)
    lawful = inverse_depth(depth[hole])
    off_surface[hole] = np.abs(lawful - w[hole]) > OFF_SURFACE * lawful
    w[hole] = lawful
    return dataclasses.replace(surfaces, off_surface=off_surface), depth, int(moved.sum())


def continue_surfaces(view: View, context: FillContext, seed: int = 0) -> Surfaces:
    """The known surfaces of a view, continued into its holes; the same seed finds the same planes."""
    known = KnownSurfaces.of(inverse_depth(view.known_depth), view.valid, view.far, seed)
    missing, by_color = view.depth_hole, None
    if missing.any():
        by_color = fill_along_colors(view.color, missing, view.hole, known)
    if by_color is not None and (by_color.reached | ~view.hole).all():
        return Surfaces(by_color.inverse_depth, by_color.label, known.planes)
    coarse = CoarseView.of(view, known, max(1.0, max(missing.shape) / GRID), context.law.misplaced_edges)
    leaves = begin_job(copy_leaves, view, known.inverse_depth, coarse.cut, seed)
    found = upsample_labels(view, known, coarse, coarse.label_costs(context), leaves)
    return found if by_color is None else set_missing_depth(found, by_color)


def set_missing_depth(found: Surfaces, by_color: DepthByColor) -> Surfaces:
    """The surfaces, with missing depth replaced along colours. Other holes are filled without these pixels."""
    there = by_color.reached
    return dataclasses.replace(
        found,
        inverse_depth=np.where(there, by_color.inverse_depth, found.inverse_depth),
        label=np.where(there, by_color.label, found.label),
        leaves=found.leaves[:, ~there.ravel()[found.leaves[0]]],
    )
