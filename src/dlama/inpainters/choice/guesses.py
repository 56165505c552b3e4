"""A view with holes in; several guesses, each with colour and inverse depth everywhere, out.

GUESSES, at the end, is the closed list of the default ones: all of them ship. Surfaces are continued once, and every Painter
paints over the same occluders. Any other filler becomes a guess by `guess_of_filler`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dlama.errors import InputError
from dlama.geometry.projection import depth_from_inverse, inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Inpainter, Painter
from dlama.inpainters.layered.depth.surface_labels import Surfaces
from dlama.inpainters.layered.depth.surfaces import continue_lawfully
from dlama.inpainters.layered.depth_first import find_occluders
from dlama.inpainters.layered.filler import inverse_of_filled, paint_surfaces
from dlama.inpainters.networks.migan import SHIPPED, migan_filler
from dlama.inpainters.networks.view_tensors import FAR_SHARE
from dlama.inpainters.spreading import Spread, pull_push, spread_small, telea_spread


@dataclass(frozen=True, eq=False)
class Guess:
    """One filler's proposal for the holes; known pixels are those of the view."""

    name: str
    color: UInt8Array
    """H x W x 3."""
    inverse_depth: Float32Array
    """H x W, 1/m, 0 = far; lawful."""


@dataclass(frozen=True, eq=False)
class PreparedView:
    """A view with its surfaces continued once, for all guesses."""

    view: View
    context: FillContext
    seed: int
    surfaces: Surfaces
    depth: Float32Array
    """H x W metres, surfaces continued, lawful."""
    occluders: BoolArray
    """H x W, known pixels hidden from the painters."""

    @classmethod
    def of(cls, view: View, context: FillContext, seed: int) -> PreparedView:
        surfaces, depth, _ = continue_lawfully(view, context, seed)
        occluders = find_occluders(view, surfaces, depth, context.law)
        return cls(view, context, seed, surfaces, depth, occluders)

    def guess(self, name: str, color: UInt8Array, depth: Float32Array) -> Guess:
        """A guess from colours (H x W x 3) and metres (H x W), of which the holes are used."""
        view = self.view
        if depth is not self.depth:
            depth, _ = self.context.law.project(view.camera, depth, view.hole)
        w = inverse_depth(np.where(view.hole, depth, view.depth))
        return Guess(name, np.where(view.color_hole[..., None], color, view.color), w)


GuessMaker = Callable[[PreparedView], Guess]
"""Makes one guess at a view."""


def make_guesses(view: View, context: FillContext, seed: int, makers: Sequence[GuessMaker]) -> tuple[Guess, ...]:
    """The guess of each maker, in their order."""
    prepared = PreparedView.of(view, context, seed)
    return tuple(make(prepared) for make in makers)


def layered_guess(prepared: PreparedView) -> Guess:
    """Surfaces painted with their own texture."""
    w = inverse_of_filled(prepared.view, prepared.surfaces, prepared.depth)
    color = paint_surfaces(prepared.view, prepared.surfaces, w, prepared.context, prepared.seed)
    return prepared.guess("layered", color, prepared.depth)


def migan_guess(prepared: PreparedView) -> Guess:
    """The network's colours on continued surfaces."""
    return painter_guess("migan", migan_filler(SHIPPED))(prepared)


def telea_guess(prepared: PreparedView) -> Guess:
    """Telea's colours and inverse depth, at `spreading.LARGEST` pixels at most."""
    return prepared.guess("telea", *_smooth(prepared, telea_spread))


def pull_push_guess(prepared: PreparedView) -> Guess:
    """Colours and inverse depth by pull-push, at `spreading.LARGEST` pixels at most."""
    return prepared.guess("pull-push", *_smooth(prepared, pull_push))


def painter_guess(name: str, painter: Inpainter) -> GuessMaker:
    """A maker that lets a Painter paint over the continued surfaces."""
    assert isinstance(painter, Painter)

    def make(prepared: PreparedView) -> Guess:
        view = prepared.view
        color = view.color
        if view.color_hole.any():
            color = painter.paint(view.color, view.color_hole | prepared.occluders, prepared.seed)
        return prepared.guess(name, color, prepared.depth)

    return make


def guess_of_filler(name: str, filler: Inpainter) -> GuessMaker:
    """The maker of any filler: a Painter's colours on continued surfaces, or both by the filler itself."""
    if isinstance(filler, Painter):
        return painter_guess(name, filler)

    def make(prepared: PreparedView) -> Guess:
        fill = filler(prepared.view, prepared.context, prepared.seed)
        return prepared.guess(name, fill.color, fill.depth)

    return make


def _smooth(prepared: PreparedView, spread: Spread) -> tuple[UInt8Array, Float32Array]:
    """Colours and metres of a view continued by `spread`, at `spreading.LARGEST` pixels at most."""
    view = prepared.view
    w = inverse_depth(view.known_depth)
    colors = spread_small(view.color, ~(view.color_hole | prepared.occluders), spread)
    depths = spread_small(w[..., None], ~(view.hole | prepared.occluders), spread)
    spread_w = np.maximum(depths[..., 0], 0)
    if view.valid.any():  # what is spread from sky alone is sky, not some kilometres off
        least = np.float32(FAR_SHARE * w[view.valid].min())
        spread_w = np.where(spread_w < least, np.float32(0) if view.far.any() else least, spread_w)
    return np.round(np.clip(colors, 0, 255)).astype(np.uint8), depth_from_inverse(spread_w)


GUESSES: dict[str, GuessMaker] = {
    "layered": layered_guess,
    "migan": migan_guess,
    "telea": telea_guess,
    "pull-push": pull_push_guess,
}
"""Name -> its maker; all ship and all run."""


def makers_of(names: Sequence[str]) -> tuple[GuessMaker, ...]:
    """The makers of these names. InputError: none, one named twice, or an unknown name (the known ones are listed)."""
    for name in names:
        if name not in GUESSES:
            raise InputError(f"guess is {name!r}; one of {', '.join(GUESSES)} is expected")
    if not names or len(set(names)) < len(names):
        raise InputError(f"guesses are {', '.join(names) or 'none'}; one or more are expected, each once")
    return tuple(GUESSES[name] for name in names)
