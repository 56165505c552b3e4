"""OpenCV's two classic fillers, Telea and Navier-Stokes: colour and depth filled apart, from all sides of the hole.

Depth goes through as inverse depth (0 = far) in 16 bit: OpenCV 5's Telea on float32 returns wrong values even on a constant
plane, on uint16 it is right.
"""

from __future__ import annotations

import functools

import numpy as np

from dlama.geometry.rendering import inverse_depth
from dlama.geometry.rgbd import Float32Array
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.filling import Fill, Inpainter

RADIUS = 3
"""Neighbourhood of cv2.inpaint in pixels."""


def diffuse(view: View, law: Law, seed: int, *, method: str) -> Fill:
    """Fill colour (8 bit) and inverse depth (16 bit, full scale = the nearest pixel) by cv2.inpaint."""
    import cv2

    flag = {"telea": cv2.INPAINT_TELEA, "navier-stokes": cv2.INPAINT_NS}[method]
    mask = view.hole.astype(np.uint8)
    color = np.asarray(cv2.inpaint(view.color, mask, RADIUS, flag), np.uint8)
    w = inverse_depth(np.where(view.hole, np.float32(0), view.depth))
    scale = float(w.max()) / 65535 or 1.0
    levels = cv2.inpaint(np.round(w / scale).astype(np.uint16), mask, RADIUS, flag)
    return Fill(color, depth_of_levels(levels, scale))


def depth_of_levels(levels: np.ndarray, scale: float) -> Float32Array:
    """Metres from inverse depth in steps of `scale` (1/m); level 0 is far (+inf)."""
    out = np.full(levels.shape, np.inf, np.float32)
    np.divide(1 / scale, levels, out=out, where=levels > 0, casting="unsafe")
    return out


telea: Inpainter = functools.partial(diffuse, method="telea")
navier_stokes: Inpainter = functools.partial(diffuse, method="navier-stokes")


def eight_bit(inpainter: Inpainter, clip_m: float) -> Inpainter:
    """The paper's way with depth: a filler's depth cut at `clip_m` and rounded to 8-bit steps of clip_m / 255."""

    def fill(view: View, law: Law, seed: int) -> Fill:
        proposal = inpainter(view, law, seed)
        step = clip_m / 255
        levels = np.clip(np.round(np.minimum(proposal.depth, clip_m) / step), 1, 255)
        return Fill(proposal.color, (levels * step).astype(np.float32), proposal.law_moves, proposal.notes)

    return fill
