"""`layered-patches`: a view with holes in; depth as of `layered`, colours from patches of the picture, out.

For removed objects, and for all holes in pictures of a depth camera. Their planes are inexact and hold several materials, so
that texture copied within a plane leaves seams; patches of the picture do not. Their search starts from the smooth colours of
the continued surfaces; behind a removed object it starts from MI-GAN's guess, which is worth its time there alone. Occluders of
a removed object are hidden from both: a table would extend to where the chair behind it was. So is the object's remaining
shadow. Next to other holes nothing is hidden, for little else is left to paint with. Behind a removed object patches come from
any surface.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import HoleType, has_code
from dlama.geometry.holes import nearest_known
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Inpainter
from dlama.inpainters.layered.color.low_frequency import begin_guess, blend_with_low_frequency
from dlama.inpainters.layered.depth.surface_labels import Surfaces
from dlama.inpainters.layered.depth.surfaces import continue_lawfully
from dlama.inpainters.layered.depth_first import find_occluders
from dlama.inpainters.layered.filler import inverse_of_filled, paint_surfaces
from dlama.inpainters.layered.remaining_shadows import find_remaining_shadow
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.patchmatch.completion import QUICK, complete_picture
from dlama.inpainters.patchmatch.filler import blend_with_guess, guess_coarsely

REPAINTED = (HoleType.OBJECT, HoleType.DISOCCLUDED, HoleType.OUT_OF_VIEW)
"""Types of holes that patches paint; cracks are too thin to gain by it."""


def layered_patches_filler(model: str | Path) -> Inpainter:
    """The filler with its network: MI-GAN's generator, or the published pipeline. FileError where the file is neither."""
    network = migan_filler(model)

    def fill(view: View, context: FillContext, seed: int) -> Fill:
        smooth = begin_guess(view)
        surfaces, depth, moved = continue_lawfully(view, context, seed)
        w = inverse_of_filled(view, surfaces, depth)
        hole = view.color_hole & has_code(
            view.hole_type, *(REPAINTED if context.misplaced_edges else (HoleType.OBJECT,))
        )
        removed = hole & (view.hole_type == HoleType.OBJECT.value)
        others = hole & ~removed
        color, notes = view.color, dict[str, Any](planes=len(surfaces.planes))
        if (view.color_hole & ~removed).any():
            color = paint_surfaces(view, surfaces, w, context, seed, detail=not context.misplaced_edges)
        if hole.any():
            label, hidden = exclude_from_patches(view, surfaces, depth, context.law, hole)
            guess, guided = color, bool(removed.any())
            if guided:
                guess = guess_coarsely(network.paint, color, removed | hidden, seed)
                notes["guess"] = network.notes()
            done = complete_picture(color, hole | hidden, guess, seed, label=label, effort=QUICK, guided=guided)
            if guided:
                done = blend_with_guess(done, guess, removed, view.color_hole | hidden)
            if others.any():
                done = blend_with_guess(done, guess, others)
            color = np.where(hidden[..., None], color, done)
        painted = view.color_hole & (surfaces.leaves < 0)
        color = blend_with_low_frequency(view, color, painted, w, surfaces.label, context.sky, smooth)
        return Fill(color, depth, moved, notes)

    return fill


def exclude_from_patches(
    view: View, surfaces: Surfaces, depth: Float32Array, law: Law, hole: BoolArray
) -> tuple[NDArray[np.int32] | None, BoolArray]:
    """(H x W surface that patches of a pixel should come from, or None for any; H x W known pixels hidden from patches).

    surfaces: as continued; depth: H x W metres, filled; hole: H x W, what patches paint.
    """
    removed = hole & (view.hole_type == HoleType.OBJECT.value)
    if not removed.any():
        return surfaces.label, np.zeros_like(hole)
    before = find_occluders(view, surfaces, depth, law) & removed.ravel()[nearest_known(hole)[1]]
    return None, before | find_remaining_shadow(view, surfaces.label, law)
