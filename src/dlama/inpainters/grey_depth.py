"""Depth as in the paper (sec. 3.3): a filler in; a filler that fills depth as an 8-bit grey picture out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Inpainter, Painter


def with_grey_depth(inpainter: Inpainter, clip: float) -> Inpainter:
    """A filler that fills depth as the paper does: as a grey picture of metres, white at `clip` metres, filled like the colours.

    The three channels that come back are averaged (the paper's conversion to grey); their mean spread is noted. A filler that
    is no Painter fills depth in its own way, and the result is rounded to the same steps.
    """

    def fill(view: View, context: FillContext, seed: int) -> Fill:
        if not isinstance(inpainter, Painter):
            own = inpainter(view, context, seed)
            notes = own.notes | {"depth_as": "the filler's own, rounded to 8 bits"}
            return Fill(own.color, metres_from_grey(grey_from_metres(own.depth, clip), clip), own.law_moves, notes)
        filled = inpainter.fill_picture(
            np.repeat(grey_from_metres(view.known_depth, clip)[..., None], 3, 2), view.hole, seed
        )
        color = inpainter.fill_picture(view.color, view.color_hole, seed) if view.color_hole.any() else view.color
        notes = {"depth_as": "8-bit picture", "depth_channel_spread": channel_spread(filled, view.hole)}
        grey = np.round(filled.mean(2)).astype(np.uint8)
        return Fill(color, metres_from_grey(grey, clip), notes=inpainter.notes() | notes)

    return fill


def grey_from_metres(depth: Float32Array, clip: float) -> UInt8Array:
    """H x W grey levels 0..255 of metres: 255 = at or beyond `clip` metres."""
    return np.round(np.minimum(depth, np.float32(clip)) * np.float32(255 / clip)).astype(np.uint8)


def metres_from_grey(grey: UInt8Array, clip: float) -> Float32Array:
    """H x W metres of grey levels; black counts as level 1, because nothing is at 0 m."""
    return (np.maximum(grey, np.uint8(1)) * np.float32(clip / 255)).astype(np.float32)


def channel_spread(picture: np.ndarray, hole: BoolArray) -> float:
    """Mean over the hole of (largest - smallest channel) of an H x W x 3 picture, in the picture's own units (paper, sec. 5)."""
    if not hole.any():
        return 0.0
    inside = picture[hole].astype(np.float32)
    return round(float((inside.max(1) - inside.min(1)).mean()), 4)
