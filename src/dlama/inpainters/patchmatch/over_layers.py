"""`layered-patches`: a view with holes in; filled as `layered` does, its colours painted anew with patches of the picture, out.

For pictures of a depth camera. Its planes are rough, and several materials lie on one of them, so that texture copied within a
plane leaves seams and scraps; the picture itself knows better. Where the source picture shows what surrounds a hole MI-GAN
guesses what is there; beyond its border, where the network would begin another room, the continued surfaces do.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.view import HoleType, View
from dlama.geometry.visibility import Law
from dlama.inpainters.filling import Fill, Inpainter
from dlama.inpainters.layered.filler import layered_fill
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

    def repaint(view: View, color: UInt8Array, label: NDArray[np.int32], seed: int) -> UInt8Array:
        hole, inner = (view.color_hole & np.isin(view.hole_type, types) for types in (REPAINTED, INNER))
        guess = network.paint(color, inner, seed) if inner.any() else color
        return complete_picture(color, hole, guess, seed, label=label, effort=QUICK)

    return fill
