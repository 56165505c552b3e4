"""Pair: both pictures of a stereo pair with holes and a network file in; each picture, painted with the other in view, out.

The network takes left and right colours, then one mask (7 -> 6: the union of both pictures' holes) or two (8 -> 6: the left
picture's hole, the right one's), and gives both; which of the two it is, its contract says. Depth is not its business:
surfaces are continued, as `depth_first` does.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama.errors import InputError
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Painter
from dlama.inpainters.networks.contract import require_planes
from dlama.inpainters.networks.engine import Engine, open_engine
from dlama.inpainters.networks.tiling import fill_crops
from dlama.inpainters.networks.view_tensors import color_from_planes, color_planes


@dataclass(frozen=True)
class PairFiller:
    """A network for pairs; `painter` makes the filler of one of its pictures."""

    network: Engine

    def __call__(self, view: View, context: FillContext, seed: int) -> Fill:
        """Not for one view alone: InputError."""
        raise InputError(
            "filler 'pair' paints both pictures of a stereo pair with `depth_by=surfaces`: `dlama stereo` runs it"
        )

    def painter(self, other: UInt8Array, other_hole: BoolArray, *, left: bool) -> Painter:
        """Fills the left (or the right) picture; other: H x W x 3, the other one, with the pixels not known of it."""

        def paint(picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
            require_planes(self.network.contract, 6, str(self.network.path), "pair")
            order = slice(None) if left else slice(None, None, -1)
            planes = np.concatenate([color_planes(picture), color_planes(other)][order])
            filled = fill_pair(self.network, planes, np.stack([hole, other_hole][order]))
            own = color_from_planes(filled[:3] if left else filled[3:])
            return np.where(hole[..., None], own, picture)

        masks = {1: "one: the union of both pictures' holes", 2: "two: the left picture's hole, the right one's"}
        return Painter(paint, self, lambda: self.network.notes | {"masks": masks[self.network.contract.masks]})


def pair_filler(model: str | Path) -> PairFiller:
    """A filler of a network file. FileError where there is no file."""
    return PairFiller(open_engine(model))


def fill_pair(network: Engine, planes: Float32Array, holes: BoolArray) -> Float32Array:
    """6 x H x W planes in 0..1 (left, right) of such planes with their holes (2 x H x W: left, right) filled.

    With one mask the network sees neither picture where either has its hole, and gives both there. With two, each picture is
    hidden and filled in its own hole only.
    """
    union, about = holes[0] | holes[1], network.contract
    if about.masks == 1:
        return network.fill(planes[None], union)[0]

    def call(both: Float32Array, union: BoolArray) -> Float32Array:
        planes, holes = both[:, :6], both[0, 6:] > 0
        filled = np.where(about.hole_of_planes(holes), network.run_planes(planes, holes), planes)
        return np.concatenate([filled, np.zeros_like(both[:, 6:])], 1)  # a filled pixel's masks are 0

    # masks travel through crops and tiles with the planes
    both = np.concatenate([planes, holes.astype(np.float32)])[None]
    return fill_crops(both, union, call, network.layout)[0, :6]
