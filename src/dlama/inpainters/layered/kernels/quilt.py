"""Quilting: known pixels of an object and where it continues in; from which known pixel each of those is copied, out (numba)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, kernel
from dlama.geometry.rgbd import Float32Array, UInt8Array

OUTSIDE, UNDECIDED, GAP = -3, -2, -1
"""What a pixel is copied from: where that is never asked, where it is not known yet, and where what is behind the object
shows."""
RIM, RIM_BUMPS = 0.8, 0.2
"""Half sides from the middle of a block to which it reaches in the first round, and how far its rim goes in and out."""


@kernel
def quilt(
    out: NDArray[np.int32],
    color: UInt8Array,
    places: NDArray[np.int32],
    corners: NDArray[np.int32],
    own: Float32Array,
    tried: NDArray[np.int32],
    there: Float32Array,
    side: Whole,
    stride: Whole,
    color_scale: Real,
    bumps: Float32Array,
) -> None:
    """Undecided pixels of `out` take, block by block, those of the known block that differs least from what is decided; in place.

    After Efros & Freeman, "Image quilting" (2001), with uneven rims (`bumps`, H x W, standard deviation 1) in place of the cut:
    a first round leaves them out, a second fills what is left. out: H x W, the pixel (flat) each is copied from, itself where
    it is known, GAP, UNDECIDED or OUTSIDE. color: H x W x 3. places: T x 2, corners (row, column) of the blocks of side x side
    pixels, in order; corners: N x 2, of known blocks; tried: T x C, numbers of known blocks; own, there: T x 2 and N x 2, what
    blocks should have alike, and color_scale grey levels, in units that count as much as a leaf where a gap should be. Every
    stride-th pixel is compared.
    """
    height, width = out.shape
    half = np.float64(side) / 2
    for turn in range(2 * len(places)):
        t, last = turn % len(places), turn >= len(places)
        y, x = places[t, 0], places[t, 1]
        top, left = max(-y, 0), max(-x, 0)
        bottom, right = min(side, height - y), min(side, width - x)
        undecided = 0
        for j in range(top, bottom):
            for i in range(left, right):
                undecided += out[y + j, x + i] == UNDECIDED
        if undecided == 0:
            continue
        best, least = np.int64(-1), np.inf
        for c in range(tried.shape[1]):
            n = np.int64(tried[t, c])
            total, count = 0.0, 1e-6
            for j in range(top, bottom, stride):
                for i in range(left, right, stride):
                    here, other = out[y + j, x + i], out[corners[n, 0] + j, corners[n, 1] + i]
                    if here < GAP:
                        continue
                    count += 1
                    if (here < 0) != (other < 0):
                        total += 1
                    elif here >= 0:
                        for k in range(3):
                            step = np.float64(color[here // width, here % width, k])
                            step = (step - color[other // width, other % width, k]) / color_scale
                            total += step * step
            first, second = own[t, 0] - there[n, 0], own[t, 1] - there[n, 1]
            value = total / count + first * first + second * second
            if value < least:
                best, least = n, value
        for j in range(top, bottom):
            for i in range(left, right):
                reach = (RIM - RIM_BUMPS * np.float64(bumps[y + j, x + i])) * half
                inside = -reach < j - half < reach and -reach < i - half < reach
                if out[y + j, x + i] == UNDECIDED and (last or inside):
                    out[y + j, x + i] = out[corners[best, 0] + j, corners[best, 1] + i]
