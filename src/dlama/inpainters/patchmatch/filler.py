"""`patchmatch`: a view with holes in; the same painted with patches of the known picture, guided by MI-GAN, out.

The network gives the structure, the picture its texture: nothing is painted that the picture does not show somewhere.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.filling import Fill, Painter
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.opencv import telea
from dlama.inpainters.patchmatch.completion import complete_picture
from dlama.inpainters.patchmatch.guess import guess_coarsely


def patchmatch_filler(model: str | Path) -> Painter:
    """The filler with its network: MI-GAN's generator, or the published pipeline. FileError where the file is neither."""
    network = migan_filler(model)

    def fill(view: View, law: Law, seed: int) -> Fill:
        return Fill(paint(view.color, view.color_hole, seed), telea(view, law, seed).depth, notes=notes())

    def paint(picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
        return complete_picture(picture, hole, guess_coarsely(network.paint, picture, hole, seed), seed)

    def notes() -> dict[str, Any]:
        return {"guess": network.notes()}

    return Painter(fill, paint, notes)
