"""The default filler: a view with holes in; depth continued from the far side of each hole, colour from that surface, out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import begin_job
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill
from dlama.inpainters.layered.color.low_frequency import blend_with_low_frequency, smooth_guess
from dlama.inpainters.layered.color.texture_grid import TextureGrid
from dlama.inpainters.layered.color.texture_synthesis import synthesize
from dlama.inpainters.layered.depth.surfaces import Surfaces, continue_lawfully
from dlama.inpainters.layered.remaining_shadows import find_remaining_shadow
from dlama.perception.planes import SKY


def layered(view: View, context: FillContext, seed: int = 0) -> Fill:
    """Continue planes, sky and smooth surfaces into the holes, project them onto the visibility law, then paint them."""
    guess = begin_job(smooth_guess, view)
    surfaces, depth, moved = continue_lawfully(view, context, seed)
    color = paint_surfaces(view, surfaces, context, seed)
    painted, w = surfaces.without_leaves(view.color_hole), surfaces.inverse_depth
    color = blend_with_low_frequency(view, color, painted, w, surfaces.label, guess)
    return Fill(color, depth, moved, {"planes": len(surfaces.planes)})


def paint_surfaces(view: View, surfaces: Surfaces, context: FillContext, seed: int, detail: bool = True) -> UInt8Array:
    """H x W x 3: the view's colours, with each surface in its colour holes painted with its own texture; surfaces: of
    `continue_lawfully`; detail: False paints smooth colours alone."""
    if not view.color_hole.any():
        return view.color
    w, label = surfaces.inverse_depth, surfaces.label.copy()
    label[view.hole & (w == 0)] = SKY
    leafy = paint_leaves(view.color, view, find_leaves(view, surfaces))
    shadow = np.zeros_like(view.hole)
    if view.object_hole.any():
        shadow = find_remaining_shadow(view, label, context.law)
    grid = TextureGrid.of(leafy, surfaces.without_leaves(view.color_hole), w, label, view.camera, spoiled=shadow)
    return synthesize(grid, seed=seed, sky=context.sky, detail=detail)


def find_leaves(view: View, surfaces: Surfaces) -> NDArray[np.intp]:
    """2 x N flat indices: hole pixels whose colour is unknown into which foliage extends, and the known leaf that each copies."""
    return surfaces.leaves[:, view.color_hole.ravel()[surfaces.leaves[0]]]


def paint_leaves(color: UInt8Array, view: View, leaves: NDArray[np.intp]) -> UInt8Array:
    """H x W x 3 colours with copied leaves (2 x N, of `find_leaves`) where foliage extends into the view's colour holes."""
    if not leaves.size:
        return color
    out = color.copy()
    out.reshape(-1, 3)[leaves[0]] = view.color.reshape(-1, 3)[leaves[1]]
    return out
