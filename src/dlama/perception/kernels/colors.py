"""Numba piece of colours: two pixels in; how far their colours are apart out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.kernels.jit import Whole, inlined
from dlama.geometry.rgbd import UInt8Array


@inlined
def color_difference(color: UInt8Array, row: Whole, column: Whole, other: UInt8Array, y: Whole, x: Whole) -> int:
    """Squared difference of a pixel's colour from that of (y, x) in another picture, in levels, summed over the channels."""
    unlike: Whole = 0
    for channel in range(3):
        apart = np.int64(color[row, column, channel]) - np.int64(other[y, x, channel])
        unlike += apart * apart
    return int(unlike)
