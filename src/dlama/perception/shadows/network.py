"""Planes of a crop round a thing in; the probability of each pixel lying in its shadow out, by a small U-Net that ships.

Beside the planes the network sees how common the colour of each pixel is on the surface, and how common it would be were it lit.
`benchmarks/shadow_network.py` trains it.
"""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np

from dlama.geometry.rgbd import Float32Array
from dlama.models.network_file import NetworkFile
from dlama.perception.shadows.features import ColorShares, color_shares

NETWORK = Path(__file__).parents[2] / "assets" / "shadow" / "shadow.onnx"
LOG_SHARE = 4.0
"""Logarithms of shares that are 1 in a plane."""


@functools.cache
def network() -> NetworkFile:
    """The network that ships, opened once a process."""
    return NetworkFile(NETWORK)


def network_planes(planes: Float32Array, shares: ColorShares | None = None) -> Float32Array:
    """The planes with two more: how common each colour is on the surface, and how much more common it would be were it lit."""
    where = planes[4] > 0.5
    share, raised = shares or color_shares(planes)
    added = np.zeros((2, *where.shape), np.float32)
    if where.any():
        added[0, where], added[1, where] = share / LOG_SHARE, (np.max(raised, 0) - share) / LOG_SHARE
    return np.concatenate([planes, added])


def network_probability(planes: Float32Array, shares: ColorShares, file: NetworkFile | None = None) -> Float32Array:
    """h x w: of each pixel of the surface; planes: `shadow_planes`, shares: `color_shares`, file: another network."""
    logits = (file or network()).run({"planes": network_planes(planes, shares)[None]})[0]
    return np.asarray(np.where(planes[4] > 0.5, 1 / (1 + np.exp(-logits)), 0), np.float32)
