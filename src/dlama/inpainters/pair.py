"""Pair: both pictures of a stereo pair with holes and a 7 -> 6 network file in; each picture painted in sight of the other, out.

The network takes left and right colours and one mask, the union of both pictures' holes, and gives both. Depth is not its
business: surfaces are continued, as `depth_first` does.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import InputError
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.contract import Contract, demand
from dlama.inpainters.engine import Engine, engine
from dlama.inpainters.filling import Fill
from dlama.inpainters.painting import Painter
from dlama.inpainters.planes_of_views import color_planes, eight_bits


@dataclass(frozen=True)
class PairFiller:
    """A network for pairs; `painter` makes the filler of one of its pictures."""

    network: Engine

    def __call__(self, view: View, law: Law, seed: int) -> Fill:
        """Not for one view alone: InputError."""
        raise InputError(
            "filler 'pair' paints both pictures of a stereo pair with depth_by surfaces: `dlama stereo` runs it"
        )

    def painter(self, other: UInt8Array, other_hole: BoolArray, *, left: bool) -> Painter:
        """Fills the left (or the right) picture; other: H x W x 3, the other one, with the pixels not known of it."""

        def paint(picture: UInt8Array, hole: BoolArray) -> UInt8Array:
            demand(self.network.contract, 6, str(self.network.path), "pair")
            mine, theirs = color_planes(picture), color_planes(other)
            planes = np.concatenate([mine, theirs] if left else [theirs, mine])
            filled = self.network.fill(planes[None], hole | other_hole)[0]
            own = eight_bits(filled[:3] if left else filled[3:])
            return np.where(hole[..., None], own, picture)

        return Painter(self, paint, lambda: self.network.notes)


def pair_filler(model: str | Path, contract: Contract | None = None, **options: Any) -> PairFiller:
    """The filler of a network file; `options` as of Engine. FileError where there is no file."""
    return PairFiller(engine(model, contract, **options))
