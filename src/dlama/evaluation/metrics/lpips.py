"""Two pictures in -> LPIPS (AlexNet, v0.1), as one number, as a map or over a region, out; by onnxruntime, no torch.

Zhang et al., "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric", CVPR 2018. The network ships
with the package (assets/lpips, made by `benchmarks/lpips_export.py`). 0 = the same; larger = more different.
"""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from dlama.errors import ShapeError, format_size
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, replace_pixels
from dlama.models.network_file import NetworkFile

NETWORK = Path(__file__).parents[2] / "assets" / "lpips" / "alex.onnx"
SMALLEST_SIDE = 31
"""Pixels: below this AlexNet's second pooling has nothing left to pool."""
REMEMBERED = 4
"""Pictures whose features are kept (10 MB each at 512x512), so that a truth is not computed again for each method."""

Features = tuple[Float32Array, ...]
"""Five taps, C x h x w each: unit-normalised features times the square root of their LPIPS weight."""


def lpips(mine: UInt8Array, truth: UInt8Array, region: BoolArray | None = None) -> float:
    """LPIPS of the whole (None), or over a region: the mean there of the map, the truth pasted outside.

    Pasting keeps what lies outside from being seen by features inside. nan where the region is empty.

    Args:
        mine, truth: uint8, H x W x 3 or H x W, sides >= 31.
        region: H x W.
    Raises:
        ShapeError: a side is too short.
    """
    if region is None:
        return distance(features(truth), features(mine))
    if not region.any():
        return math.nan
    pasted = features(replace_pixels(truth, region, mine))
    return float(distance_map(features(truth), pasted, truth.shape[:2])[region].mean())


def features(picture: UInt8Array) -> Features:
    """The five taps of a picture.

    Args:
        picture: uint8, H x W x 3 RGB, or H x W (depth), which is replicated to three channels; sides >= 31.
    Raises:
        ShapeError: a side is too short.
    """
    if min(picture.shape[:2]) < SMALLEST_SIDE:
        raise ShapeError(
            f"LPIPS: the picture is {format_size(picture.shape)}; {SMALLEST_SIDE}x{SMALLEST_SIDE} or more is expected"
        )
    return _features(picture.tobytes(), picture.shape)


@lru_cache(maxsize=REMEMBERED)
def _features(levels: bytes, shape: tuple[int, ...]) -> Features:
    picture = np.frombuffer(levels, np.uint8).reshape(*shape[:2], -1)
    planes = np.broadcast_to(picture, (*shape[:2], 3)).astype(np.float32) * np.float32(2 / 255) - np.float32(1)
    batch = np.ascontiguousarray(planes.transpose(2, 0, 1)[None])  # -1..1
    return tuple(tap[0] for tap in _network().run_all({"picture": batch}))


def distance(a: Features, b: Features) -> float:
    """LPIPS of two pictures by their features: the mean over each tap's own map, summed over taps."""
    return float(sum(tap.mean() for tap in _tap_maps(a, b)))


def distance_map(a: Features, b: Features, hw: tuple[int, int]) -> Float64Array:
    """LPIPS of every pixel, H x W: each tap's map, bilinearly enlarged to `hw` (pixel centres kept), summed.

    As the published code's `spatial=True` does it. Its mean is near `distance`, not equal: enlarging weighs the
    border otherwise.
    """
    maps = [cv2.resize(tap, hw[::-1], interpolation=cv2.INTER_LINEAR) for tap in _tap_maps(a, b)]
    return np.sum(maps, axis=0, dtype=np.float64)


@lru_cache
def _network() -> NetworkFile:
    return NetworkFile(NETWORK, "cpu", threads=1)  # frames run side by side


def _tap_maps(a: Features, b: Features) -> list[Float64Array]:
    """The squared difference of each tap, summed over channels: five h x w."""
    return [np.einsum("chw,chw->hw", d, d).astype(np.float64) for d in (first - second for first, second in zip(a, b))]
