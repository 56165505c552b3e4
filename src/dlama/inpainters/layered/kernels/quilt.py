"""Quilting: known pixels of an object and its extent in; the known pixel that each other one is copied from out (numba)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, inlined, kernel
from dlama.geometry.rgbd import Float32Array, UInt8Array

OUTSIDE, UNDECIDED, GAP = -3, -2, -1
"""Source of a pixel: not needed, not decided yet, and a gap that shows the background."""
RIM, RIM_BUMPS = 0.8, 0.2
"""Reach of a block in the first round, in half sides from its middle, and the variation of its rim."""


@inlined
def compare_blocks(
    out: NDArray[np.int32],
    color: UInt8Array,
    y: Whole,
    x: Whole,
    known_y: Whole,
    known_x: Whole,
    side: Whole,
    stride: Whole,
    color_scale: Real,
) -> Real:
    """Mean difference of a known block (corner: known_y, known_x) from what is decided in the block at (y, x), which may reach
    beyond the picture; other arguments as of `quilt`."""
    height, width = out.shape
    total, count = 0.0, 1e-6
    for j in range(max(-y, 0), min(side, height - y), stride):
        for i in range(max(-x, 0), min(side, width - x), stride):
            here, other = out[y + j, x + i], out[known_y + j, known_x + i]
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
    return total / count


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
    """Fill undecided pixels of `out`, block by block, from the known block that differs least from what is decided; in place.

    After Efros & Freeman, "Image quilting" (2001), with uneven rims (`bumps`, H x W, standard deviation 1) in place of the cut:
    a first round leaves them out, a second fills the rest. out: H x W, flat index of each pixel's source, its own where known,
    GAP, UNDECIDED or OUTSIDE. color: H x W x 3. places: T x 2, corners (row, column) of the blocks of side x side pixels, in
    order; corners: N x 2, of known blocks; tried: T x C, numbers of known blocks; own, there: T x 2 and N x 2, features that
    blocks should share; color_scale: grey levels that cost as much as a leaf in place of a gap. Every stride-th pixel is
    compared.
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
            unlike = compare_blocks(out, color, y, x, corners[n, 0], corners[n, 1], side, stride, color_scale)
            first, second = own[t, 0] - there[n, 0], own[t, 1] - there[n, 1]
            value = unlike + first * first + second * second
            if value < least:
                best, least = n, value
        for j in range(top, bottom):
            for i in range(left, right):
                reach = (RIM - RIM_BUMPS * np.float64(bumps[y + j, x + i])) * half
                inside = -reach < j - half < reach and -reach < i - half < reach
                if out[y + j, x + i] == UNDECIDED and (last or inside):
                    out[y + j, x + i] = out[corners[best, 0] + j, corners[best, 1] + i]
