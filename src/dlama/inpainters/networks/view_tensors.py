"""Views in, planes in 0..1 for a network out; and back: colour in 8 bit, inverse depth in metres without 8-bit steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.networks.contract import DEPTH_AT_QUANTILE, DEPTH_QUANTILE


def nearest_scale(w: Float32Array) -> float:
    """The inverse depth (1/m) that is called 1: the nearest pixel's; w: inverse depths, 0 = far or unknown."""
    return float(w.max(initial=0)) or 1.0


def robust_scale(w: Float32Array) -> float:
    """The inverse depth (1/m) that is called 1, as contracts with a depth plane want it (`contract.DEPTH_PLANE`): a few flying
    pixels do not change it. w: as nearest_scale."""
    known = w[w > 0]
    return float(np.quantile(known, DEPTH_QUANTILE)) / DEPTH_AT_QUANTILE if known.size else 1.0


@dataclass(frozen=True, eq=False)
class DepthPlane:
    """Inverse depth of a view on a scale of its own, so that the scene's scale never matters; 0 = infinity."""

    values: Float32Array
    """H x W in 0..1, 0 = infinity and in holes. Known pixels beyond the scale stand at 1."""
    scale: float
    """1/m at 1."""
    far_below: float
    """Filled values below this are far: half the smallest known one, in a view that shows far pixels; else 0."""

    @classmethod
    def of(cls, view: View, scale: Callable[[Float32Array], float] = nearest_scale) -> DepthPlane:
        w = inverse_depth(view.known_depth)
        one = scale(w)
        values = np.minimum(w / np.float32(one), np.float32(1)).astype(np.float32)
        known = values[view.valid]
        below = 0.5 * float(known.min()) if known.size and view.far.any() else 0.0
        return cls(values, one, below)

    def metres(self, values: Float32Array) -> Float32Array:
        """H x W metres of filled values; far is +inf."""
        out = np.full(values.shape, np.inf, np.float32)
        near = values > max(self.far_below, 1e-7)
        np.divide(np.float32(1 / self.scale), values, out=out, where=near)
        return out


def color_planes(picture: UInt8Array) -> Float32Array:
    """3 x H x W in 0..1 of H x W x 3."""
    return (picture.transpose(2, 0, 1) / np.float32(255)).astype(np.float32)


def levels_of(values: np.ndarray) -> UInt8Array:
    """Values of 0..1, clipped, as levels of 8 bit."""
    return np.asarray(np.round(np.clip(values, 0, 1) * 255).astype(np.uint8))


def color_from_planes(planes: Float32Array) -> UInt8Array:
    """H x W x 3 colours of 3 x H x W planes."""
    return np.ascontiguousarray(levels_of(planes).transpose(1, 2, 0))
