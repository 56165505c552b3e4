"""`layered-patches`: a view with holes in; depth as of `layered`, colours of the surfaces, of patches and of a network, out.

The default for measured depth. Behind removed objects and in dis-occlusions the colours are a mean of what MI-GAN paints in the
whole view and of the picture's own texture: each errs elsewhere. It does not see occluders of what is filled next to them, nor
the remaining shadow of a removed object: a table would extend to where the chair before it was. Patches of the picture are copied
over the surfaces' smooth colours behind a removed object, there from any surface and from MI-GAN's guess on, and in all pictures
of a depth camera: planes of such depth are inexact and hold several materials, so that texture copied within a plane leaves
seams. Out of a depth camera's view patches begin from the mean of surfaces and guess, since such planes end in the wrong places.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dlama.geometry.codes import HoleType
from dlama.geometry.holes import nearest_known
from dlama.geometry.kernels.jit import begin_job
from dlama.geometry.rgbd import BoolArray, UInt8Array, paste, replace_pixels
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Inpainter
from dlama.inpainters.layered.color.low_frequency import blend_with_low_frequency, smooth_guess, unseen_colors
from dlama.inpainters.layered.depth.surfaces import Surfaces, continue_lawfully
from dlama.inpainters.layered.depth_first import hide_from_painter
from dlama.inpainters.layered.filler import paint_surfaces
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.patchmatch.completion import QUICK, complete_picture
from dlama.inpainters.patchmatch.filler import GUESS_SIDE, blend_with_guess, guess_coarsely

VIEW_SIDE = 256
"""Longer side of the picture that the network paints where nothing is removed: 384 pixels take twice the time, for LPIPS -3 %."""
DISOCCLUDED_SHARE = 0.4
"""Weight of the network's picture in dis-occlusions. Out of view houses that it guesses would shine through the sky."""


def layered_patches_filler(model: str | Path) -> Inpainter:
    """The filler with its network: MI-GAN's generator, or the published pipeline. FileError where the file is neither."""
    network = migan_filler(model)

    def fill(view: View, context: FillContext, seed: int) -> Fill:
        smooth = begin_job(smooth_guess, view)
        surfaces, depth, moved = continue_lawfully(view, context, seed)
        notes: dict[str, Any] = {"planes": len(surfaces.planes)}
        hidden = view.color_hole
        removed, uncovered = (
            hidden & (view.hole_type == kind.value) for kind in (HoleType.OBJECT, HoleType.DISOCCLUDED)
        )
        copied = removed
        if context.law.misplaced_edges:  # cracks are too thin to gain by patches
            copied = removed | uncovered | unseen_colors(view)
        guessed = copied.any() or uncovered.any()
        if guessed:
            coarsely = not removed.any()
            hidden, shadow_notes = hide_from_painter(view, surfaces, depth, context.law, coarsely)
            notes |= shadow_notes
            side = VIEW_SIDE if coarsely else GUESS_SIDE
            guessing = begin_job(guess_coarsely, network.paint, view.color, hidden, seed, side)
        color = view.color
        if (view.color_hole & ~removed).any():
            color = paint_surfaces(view, surfaces, context, seed, detail=not context.law.misplaced_edges)
        guess = color
        if guessed:
            guess = guessing()
            notes["guess"] = network.notes()
        if copied.any():
            color = copy_patches(view, surfaces, color, guess, copied, hidden, seed)
        painted, w = surfaces.without_leaves(view.color_hole), surfaces.inverse_depth
        color = blend_with_low_frequency(view, color, painted, w, surfaces.label, smooth)
        if uncovered.any():
            color = blend_with_guess(color, guess, uncovered, guess_share=DISOCCLUDED_SHARE)
        return Fill(color, depth, moved, notes)

    return fill


def copy_patches(
    view: View,
    surfaces: Surfaces,
    color: UInt8Array,
    guess: UInt8Array,
    copied: BoolArray,
    hidden: BoolArray,
    seed: int,
) -> UInt8Array:
    """H x W x 3: colours with patches of the picture in `copied` (H x W).

    surfaces: as continued; color: H x W x 3, painted but for removed objects; guess: H x W x 3, the network's; hidden: H x W,
    what it did not see.
    """
    removed, unseen = (copied & (view.hole_type == kind.value) for kind in (HoleType.OBJECT, HoleType.OUT_OF_VIEW))
    near = hidden & ~view.color_hole & removed.any()
    if near.any():
        near &= removed.ravel()[nearest_known(copied)[1]]
    start = replace_pixels(color, removed | near, guess)
    label = None if removed.any() else surfaces.label
    if unseen.any():
        start[unseen] = (color[unseen].astype(np.uint16) + guess[unseen]) // 2
    out, levels = complete_picture(color, copied | near, start, seed, label=label, effort=QUICK)
    if removed.any():
        spread = np.zeros(removed.shape, np.float32)
        spread[copied | near] = levels
        out = blend_with_guess(out, start, removed, view.color_hole | near, spread=spread)
    if (copied & ~removed).any():
        out = blend_with_guess(out, start, copied & ~removed)
    paste(color, near, out)
    return out
