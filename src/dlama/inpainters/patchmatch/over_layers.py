"""`layered-patches`: a view with holes in; filled as `layered` does, its colours painted anew with patches of the picture, out.

For removed objects, and for all holes in pictures of a depth camera. Its planes are rough, and several materials lie on one of
them, so that texture copied within a plane leaves seams and scraps; the picture itself knows better. Where the source picture
shows what surrounds a hole MI-GAN
guesses what is there; beyond its border, where the network would begin another room, the continued surfaces do. What stands
in front of a removed object is hidden from both: a table would extend to where the chair behind it was. Next to other holes it is
not, for it is most of what there is to paint with. Behind a removed object patches come from any surface.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import nearest_known
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.geometry.view import HoleType, View
from dlama.geometry.visibility import Law
from dlama.inpainters.filling import Fill, Inpainter
from dlama.inpainters.layered.depth_first import occluders
from dlama.inpainters.layered.filler import layered_fill
from dlama.inpainters.layered.surfaces import Surfaces
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.patchmatch.completion import QUICK, complete_picture

INNER = (HoleType.OBJECT, HoleType.DISOCCLUDED)
"""Holes that the network guesses."""
REPAINTED = (*INNER, HoleType.OUT_OF_VIEW)
"""Holes that are painted anew; cracks are too thin to gain by it."""


def layered_patches_filler(model: str | Path) -> Inpainter:
    """The filler with its network: MI-GAN's generator, or the published pipeline. FileError where the file is neither."""
    network = migan_filler(model)

    def fill(view: View, law: Law, seed: int) -> Fill:
        done = layered_fill(view, law, seed, repaint)
        return dataclasses.replace(done, notes=done.notes | {"guess": network.notes()})

    def repaint(
        view: View, surfaces: Surfaces, depth: Float32Array, color: UInt8Array, law: Law, seed: int
    ) -> UInt8Array:
        painted = REPAINTED if law.misplaced_edges else (HoleType.OBJECT,)
        hole = view.color_hole & np.isin(view.hole_type, painted)
        inner = hole & np.isin(view.hole_type, INNER)
        if not hole.any():
            return color
        label: NDArray[np.int32] | None = surfaces.label
        before = np.zeros_like(hole)
        if (removed := hole & (view.hole_type == HoleType.OBJECT)).any():
            before = occluders(view, surfaces, depth, law) & removed.ravel()[nearest_known(hole)[1]]
            label = None
        guess = network.paint(color, inner | before, seed) if inner.any() else color
        done = complete_picture(color, hole | before, guess, seed, label=label, effort=QUICK)
        return np.where(before[..., None], color, done)

    return fill
