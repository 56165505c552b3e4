"""A picture with inverse depth and surface labels everywhere in; the means of each surface's own pixels over cells out."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.layered.kernels.cells import UNTRUSTED, Cells, Labels, shrink, trusted_sources

FEW, SHARE_LEFT = 100, 0.25
"""Least number and share of a surface's pixels that must remain trusted; below, pixels nearer to occluders are trusted, too:
leaves have no others."""
BAND = 256
"""Rows that are counted at a time."""
LONGER_SIDE = 256
"""Of the grid, in cells."""


def divide_into_cells(
    color: UInt8Array, hole: BoolArray, inverse_depth: Float32Array, label: Labels, spoiled: BoolArray
) -> tuple[Cells, int]:
    """The cells of arrays of one size (H x W), and the pixels along a side of each; what is `spoiled` counts only where all of
    its surface is."""
    size = max(1, -(-max(hole.shape) // LONGER_SIDE))
    trusted = trusted_labels(hole, inverse_depth, label)
    if spoiled.any():
        left = np.flatnonzero(count_labels(trusted, ~spoiled)) + UNTRUSTED
        trusted[spoiled & is_one_of(trusted, left)] = UNTRUSTED
    return shrink(color, inverse_depth, trusted, size), size


def trusted_labels(hole: BoolArray, inverse_depth: Float32Array, label: Labels) -> Labels:
    """H x W: the label of every pixel that shows its surface's own colour, UNTRUSTED elsewhere.

    Trusted pixels are two pixels from holes and nearer surfaces; closer ones count where too few are left (FEW, SHARE_LEFT).
    """
    trusted = np.where(trusted_sources(hole, inverse_depth, label, 2), label, np.int8(UNTRUSTED))
    needed, known = count_labels(label, hole), count_labels(label, ~hole)
    for reach in (1, 0):
        enough = count_labels(trusted, ~hole) > np.maximum(FEW, SHARE_LEFT * known)
        missing = np.flatnonzero((needed > 0) & ~enough) + UNTRUSTED
        if len(missing):
            near = is_one_of(label, missing) & trusted_sources(hole, inverse_depth, label, reach)
            trusted[near] = label[near]
    return trusted


def count_labels(label: Labels, where: BoolArray) -> NDArray[np.int64]:
    """How many pixels of `where` (H x W) have each label (H x W), from UNTRUSTED on."""
    out = np.zeros(256, np.int64)
    for first in range(0, len(label), BAND):  # OpenCV gives float32, which counts to 16 million
        codes, counted = (one[first : first + BAND].view(np.uint8) for one in (label, where))
        out += cv2.calcHist([codes], [0], counted, [256], [0, 256]).ravel().astype(np.int64)
    return np.roll(out, -UNTRUSTED)


def is_one_of(label: Labels, numbers: NDArray[np.int64]) -> BoolArray:
    """H x W, True where the label (H x W) is one of the few `numbers`."""
    out = np.zeros(label.shape, np.bool_)
    for number in numbers.tolist():
        out |= label == number
    return out
