"""Views in, planes in 0..1 for a network out; and back: colour in 8 bit, inverse depth in metres without 8-bit steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlama.geometry.rendering import inverse_depth
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.geometry.view import View

FARTHER = 0.5
"""Filled inverse depth below this share of the smallest known one is far, in a view that shows far pixels."""


@dataclass(frozen=True, eq=False)
class DepthPlane:
    """Inverse depth of a view on the scale of its nearest pixel."""

    values: Float32Array
    """H x W in 0..1, 1 = nearest, 0 = infinity and in holes."""
    scale: float
    """1/m at 1."""
    far_below: float
    """Filled values below this are far (0: only what is not above 0)."""

    @classmethod
    def of(cls, view: View) -> DepthPlane:
        w = inverse_depth(np.where(view.hole, np.float32(0), view.depth))
        scale = float(w.max()) or 1.0
        values = (w / np.float32(scale)).astype(np.float32)
        known = values[view.valid]
        below = FARTHER * float(known.min()) if known.size and view.far.any() else 0.0
        return cls(values, scale, below)

    def metres(self, values: Float32Array) -> Float32Array:
        """H x W metres of filled values; far is +inf."""
        out = np.full(values.shape, np.inf, np.float32)
        near = values > max(self.far_below, 1e-7)
        np.divide(np.float32(1 / self.scale), values, out=out, where=near)
        return out


def color_planes(picture: UInt8Array) -> Float32Array:
    """3 x H x W in 0..1 of H x W x 3."""
    return (picture.transpose(2, 0, 1) / np.float32(255)).astype(np.float32)


def eight_bits(planes: Float32Array) -> UInt8Array:
    """H x W x 3 colours of 3 x H x W planes."""
    return np.ascontiguousarray(np.round(np.clip(planes, 0, 1) * 255).astype(np.uint8).transpose(1, 2, 0))
