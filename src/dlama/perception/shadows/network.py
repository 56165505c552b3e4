"""Planes of a crop round an object in; the probability of each pixel lying in its shadow out, by a small U-Net that ships.

Further inputs are the frequency of each pixel's colour on the surface, and of the same colour if it were lit.
`benchmarks/shadow_network.py` trains it.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.rgbd import Float32Array
from dlama.models.network_file import ASSETS, NetworkFile, shipped_network
from dlama.perception.shadows.planes import LOG_RANGE, ShadowPlanes

NETWORK = ASSETS / "shadow" / "shadow.onnx"
LOG_SHARE = 4.0
"""Logarithm of a frequency that is 1 in a plane."""
HUES, HUE_RANGE, HUE_BLUR_PX = 32, 1.0, 1.0
"""Bins of the logarithms of red and blue over green, how far from 0 they reach, and the blur of colours before."""


def network_planes(planes: ShadowPlanes) -> Float32Array:
    """The planes with three more: frequency of each colour on the surface, gain in frequency if it were lit, and darkness
    relative to its hue (`darkness_by_hue`)."""
    where = planes.surface
    share, raised = planes.shares
    added = np.zeros((3, *where.shape), np.float32)
    if where.any():
        added[0, where], added[1, where] = share / LOG_SHARE, (np.max(raised, 0) - share) / LOG_SHARE
        added[2] = darkness_by_hue(planes)
    return np.concatenate([planes.values, added])


def darkness_by_hue(planes: ShadowPlanes) -> Float32Array:
    """h x w mean log level of all surface pixels with similar ratios of red, green and blue, over the pixel's own. A shadow is
    equally far below its own material on a rug and on the floor next to it. 0 off the surface."""
    where = planes.surface
    color = np.stack([cv2.GaussianBlur(plane, (0, 0), HUE_BLUR_PX) for plane in planes.color])[:, where] * LOG_RANGE
    ratios = np.clip((np.stack([color[0] - color[1], color[2] - color[1]]) / HUE_RANGE + 1) / 2, 0, 0.9999)
    place, level = (ratios * HUES).astype(int), color.mean(0)
    flat = place[0] * HUES + place[1]
    count, total = (
        cv2.GaussianBlur(np.bincount(flat, each, HUES**2).astype(np.float32).reshape(HUES, HUES), (0, 0), 1.0)
        for each in (None, level)
    )
    out = np.zeros(where.shape, np.float32)
    out[where] = (total / np.maximum(count, 1e-3)).ravel()[flat] - level
    return out


def network_probability(planes: ShadowPlanes, file: NetworkFile | None = None) -> Float32Array:
    """h x w probability of each pixel of the surface; file: another network."""
    logits = (file or shipped_network(NETWORK)).run({"planes": network_planes(planes)[None]})[0]
    return np.asarray(np.where(planes.surface, 1 / (1 + np.exp(-logits)), 0), np.float32)
