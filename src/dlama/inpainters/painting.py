"""Fillers of pictures, and the paper's way with them: colour and an 8-bit picture of depth filled apart by the same means."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import Origin, View
from dlama.geometry.visibility import Law
from dlama.inpainters.filling import Fill, Inpainter

Paint = Callable[[UInt8Array, BoolArray], UInt8Array]
"""(H x W x 3 picture, H x W hole) -> H x W x 3 picture with the hole filled."""
LEVELS = 255


@dataclass(frozen=True)
class Painter:
    """A filler that can also fill any 8-bit picture: diffusion, and networks that fill colour."""

    fill: Inpainter
    """What it does with a view, when nothing else is asked."""
    paint: Paint
    notes: Callable[[], dict[str, Any]] = field(default=dict)
    """What ran, for meta.json."""

    def __call__(self, view: View, law: Law, seed: int) -> Fill:
        return self.fill(view, law, seed)


def color_hole(view: View) -> BoolArray:
    """Hole pixels whose colour is not known either."""
    return view.hole & (view.origin != Origin.DEPTH_FILLED)


def eight_bit(inpainter: Inpainter, clip_m: float) -> Inpainter:
    """The paper's way with depth (sec. 3.3): a grey 8-bit picture of metres, white at `clip_m`, filled like the colours.

    The three channels that come back are averaged (the paper's conversion to grey); how far apart they were is noted. A
    filler that fills no pictures keeps its own way with depth, and what it gives is rounded to the same steps.
    """

    def fill(view: View, law: Law, seed: int) -> Fill:
        if not isinstance(inpainter, Painter):
            own = inpainter(view, law, seed)
            notes = own.notes | {"depth_as": "the filler's own, rounded to 8 bits"}
            return Fill(own.color, metres(levels(own.depth, clip_m), clip_m), own.law_moves, notes)
        grey = np.repeat(levels(np.where(view.hole, np.float32(0), view.depth), clip_m)[..., None], 3, 2)
        filled = inpainter.paint(grey, view.hole)
        open_color = color_hole(view)
        color = inpainter.paint(view.color, open_color) if open_color.any() else view.color
        notes = {"depth_as": "8-bit picture", "depth_channel_spread": channel_spread(filled, view.hole)}
        mean = np.round(filled.mean(2)).astype(np.uint8)
        return Fill(color, metres(mean, clip_m), notes=inpainter.notes() | notes)

    return fill


def levels(depth: Float32Array, clip_m: float) -> UInt8Array:
    """H x W grey levels of metres: 255 = at or beyond `clip_m`."""
    return np.round(np.minimum(depth, np.float32(clip_m)) * np.float32(LEVELS / clip_m)).astype(np.uint8)


def metres(grey: UInt8Array, clip_m: float) -> Float32Array:
    """H x W metres of grey levels; black counts as level 1, for nothing is at 0 m."""
    return (np.maximum(grey, np.uint8(1)) * np.float32(clip_m / LEVELS)).astype(np.float32)


def channel_spread(picture: np.ndarray, hole: BoolArray) -> float:
    """Mean difference between the largest and the smallest channel in the hole, in the picture's own units (paper, sec. 5)."""
    if not hole.any():
        return 0.0
    inside = picture[hole].astype(np.float32)
    return round(float((inside.max(1) - inside.min(1)).mean()), 4)
