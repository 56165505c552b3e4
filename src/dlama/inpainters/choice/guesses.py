"""A view with holes in; several guesses at what is there, each with colour and inverse depth everywhere, out.

GUESSES, at the foot, is the closed list of those that run without being asked: all of them ship. Surfaces are continued once, and
every guess that paints pictures paints over the same occluders. Any other filler becomes a guess by `guess_of_filler`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dlama.errors import InputError
from dlama.geometry.projection import depth_from_inverse, inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.geometry.visibility import Law, lawful_depth
from dlama.inpainters import ASSETS, FILLERS
from dlama.inpainters.filling import Inpainter, Painter
from dlama.inpainters.layered.depth_first import occluders
from dlama.inpainters.layered.filler import painted, surfaces_behind
from dlama.inpainters.layered.surfaces import Surfaces
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.networks.view_tensors import FAR_SHARE
from dlama.inpainters.opencv import telea

DIFFUSED_SIZE = 512
"""Longer side of the picture that Telea fills, in pixels: it is a blur in any case."""


@dataclass(frozen=True, eq=False)
class Guess:
    """What one filler would put into the holes; known pixels are those of the view."""

    name: str
    color: UInt8Array
    """H x W x 3."""
    inverse_depth: Float32Array
    """H x W, 1/m, 0 = far; lawful."""


@dataclass(frozen=True, eq=False)
class Ground:
    """What all guesses of a view share."""

    view: View
    law: Law
    seed: int
    surfaces: Surfaces
    depth: Float32Array
    """H x W metres, surfaces continued, lawful."""
    occluders: BoolArray
    """H x W, known pixels whose colours do not belong into the holes beside them."""

    @classmethod
    def of(cls, view: View, law: Law, seed: int) -> Ground:
        surfaces, depth, _ = surfaces_behind(view, law, seed)
        return cls(view, law, seed, surfaces, depth, occluders(view, surfaces, depth))

    def guess(self, name: str, color: UInt8Array, depth: Float32Array) -> Guess:
        """A guess of colours (H x W x 3) and metres (H x W), of which the holes are used."""
        view = self.view
        if depth is not self.depth:
            depth, _ = lawful_depth(view, depth, view.hole, self.law)
        w = inverse_depth(np.where(view.hole, depth, view.depth))
        return Guess(name, np.where(view.color_hole[..., None], color, view.color), w)


Plug = Callable[[Ground], Guess]
"""What makes one guess."""


def make_guesses(view: View, law: Law, seed: int, plugs: Sequence[Plug]) -> tuple[Guess, ...]:
    """The guess of each plug, in their order."""
    ground = Ground.of(view, law, seed)
    return tuple(plug(ground) for plug in plugs)


def layered(ground: Ground) -> Guess:
    """Surfaces painted with their own texture."""
    color = painted(ground.view, ground.surfaces, ground.depth, ground.law, ground.seed)
    return ground.guess("layered", color, ground.depth)


def migan(ground: Ground) -> Guess:
    """The network's colours on continued surfaces."""
    return painter_guess("migan", migan_filler(ASSETS / str(FILLERS["migan"].shipped)))(ground)


def diffused(ground: Ground) -> Guess:
    """Telea's colours and inverse depth, at DIFFUSED_SIZE pixels at most."""
    return ground.guess("telea", *_smooth(ground, _telea))


def pulled(ground: Ground) -> Guess:
    """Colours and inverse depth by pull-push."""
    return ground.guess("pull-push", *_smooth(ground, pull_push))


def painter_guess(name: str, painter: Inpainter) -> Plug:
    """A plug that lets a Painter paint over the continued surfaces."""
    assert isinstance(painter, Painter)

    def plug(ground: Ground) -> Guess:
        view = ground.view
        color = view.color
        if view.color_hole.any():
            color = painter.paint(view.color, view.color_hole | ground.occluders)
        return ground.guess(name, color, ground.depth)

    return plug


def guess_of_filler(name: str, filler: Inpainter) -> Plug:
    """A plug of any filler: a Painter's colours on continued surfaces, or both by the filler itself."""
    if isinstance(filler, Painter):
        return painter_guess(name, filler)

    def plug(ground: Ground) -> Guess:
        fill = filler(ground.view, ground.law, ground.seed)
        return ground.guess(name, fill.color, fill.depth)

    return plug


Spread = Callable[[Float32Array, BoolArray], Float32Array]
"""(H x W x C values, H x W known) -> H x W x C, known values continued into the rest."""


def _smooth(ground: Ground, spread: Spread) -> tuple[UInt8Array, Float32Array]:
    """Colours and metres of a view continued by `spread`, at DIFFUSED_SIZE pixels at most."""
    view = ground.view
    w = inverse_depth(np.where(view.hole, np.float32(0), view.depth))
    colors = _spread_small(view.color.astype(np.float32), ~(view.color_hole | ground.occluders), spread)
    depths = _spread_small(w[..., None], ~(view.hole | ground.occluders), spread)
    spread_w = np.maximum(depths[..., 0], 0)
    if view.valid.any():  # what is spread from sky alone is sky, not some kilometres off
        least = np.float32(FAR_SHARE * w[view.valid].min())
        spread_w = np.where(spread_w < least, np.float32(0) if view.far.any() else least, spread_w)
    return np.round(np.clip(colors, 0, 255)).astype(np.uint8), depth_from_inverse(spread_w)


def _spread_small(values: Float32Array, known: BoolArray, spread: Spread) -> Float32Array:
    """H x W x C by `spread`, computed at a smaller size where the picture is large."""
    height, width = known.shape
    by = min(1.0, DIFFUSED_SIZE / max(height, width))
    size = max(1, round(width * by)), max(1, round(height * by))
    share = cv2.resize(known.astype(np.float32), size, interpolation=cv2.INTER_AREA)[..., None]
    small = cv2.resize(values * known[..., None], size, interpolation=cv2.INTER_AREA).reshape(*share.shape[:2], -1)
    filled = spread((small / np.maximum(share, 1e-6)).astype(np.float32), share[..., 0] >= 0.5)
    back = cv2.resize(filled, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(back, np.float32).reshape(height, width, -1)


def _telea(values: Float32Array, known: BoolArray) -> Float32Array:
    """As Spread, by Telea: three channels in 8 bit, one in 16."""
    if not known.any():
        return values
    if values.shape[2] == 3:
        return telea.paint(np.round(np.clip(values, 0, 255)).astype(np.uint8), ~known).astype(np.float32)
    scale = float(values[known].max()) / 65535 or 1.0
    levels = np.round(np.clip(values[..., 0] / scale, 0, 65535)).astype(np.uint16)
    return (telea.paint(levels, ~known) * np.float32(scale))[..., None]


def pull_push(values: Float32Array, known: BoolArray) -> Float32Array:
    """As Spread: coarser the farther off (pull-push, Gortler et al. 1996)."""
    weight = known.astype(np.float32)
    levels: list[tuple[np.ndarray, np.ndarray]] = [(values * weight[..., None], weight)]
    while max(levels[-1][1].shape) > 2:
        levels.append((_halved(levels[-1][0]), cv2.pyrDown(levels[-1][1])))
    sums, weight = levels[-1]
    mean = sums / np.maximum(weight, 1e-6)[..., None]
    for sums, weight in reversed(levels[:-1]):
        coarser = cv2.pyrUp(mean, dstsize=(weight.shape[1], weight.shape[0])).reshape(sums.shape)
        share = np.minimum(weight, 1)[..., None]
        mean = sums / np.maximum(weight, 1e-6)[..., None] * share + coarser * (1 - share)
    return mean.astype(np.float32)


def _halved(values: np.ndarray) -> np.ndarray:
    small = cv2.pyrDown(values)
    return small.reshape(*small.shape[:2], -1)


GUESSES: dict[str, Plug] = {"layered": layered, "migan": migan, "telea": diffused, "pull-push": pulled}
"""Name -> plug; all ship and all run."""


def plugs_of(names: Sequence[str]) -> tuple[Plug, ...]:
    """The plugs of these names. InputError: none, one named twice, or an unknown name (the known ones are listed)."""
    for name in names:
        if name not in GUESSES:
            raise InputError(f"guess is {name!r}; one of {', '.join(GUESSES)} is wanted")
    if not names or len(set(names)) < len(names):
        raise InputError(f"guesses are {', '.join(names) or 'none'}; one or more are wanted, each once")
    return tuple(GUESSES[name] for name in names)
