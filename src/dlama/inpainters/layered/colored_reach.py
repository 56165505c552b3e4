"""Known surfaces of a coarse grid and colours where depth alone is missing in; how far each surface reaches through them out."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.layered.kernels.reach import sweep_by_color

COLOR_STEP, DEAREST = 20.0, 20.0
"""Levels (root of the sum over channels) between neighbouring cells that make a step twice as long; the most that they add."""
ROUNDS = 2
"""Sweeps there and back: ways that wind more often are not found."""


def colors_of_cells(color: UInt8Array, colored: BoolArray) -> Float32Array:
    """h x w x 3 mean colours of an H x W picture, if any cell of `colored` (h x w) wants them; else 0."""
    if not colored.any():
        return np.zeros((*colored.shape, 3), np.float32)
    return cv2.resize(color, colored.shape[::-1], interpolation=cv2.INTER_AREA).astype(np.float32)


def distances_by_color(known: BoolArray, colored: BoolArray, color: Float32Array) -> Float32Array:
    """L x h x w lengths, in cells, of the shortest ways through the `colored` cells from those of `known`, longer across colours.

    known: L x h x w, the known cells of each surface; colored: h x w; color: h x w x 3. 1000 where no way leads.
    """
    out = np.where(known, np.float32(0), np.float32(1e3))
    in_bands(sweep_by_color, len(out), out, colored, color, COLOR_STEP, DEAREST, ROUNDS, band=1)
    return out
