"""A picture, and what of it is known, in; what patches are compared by, at its size and at half of it, out (numba)."""

from __future__ import annotations

import numpy as np

from dlama.geometry.kernels.jit import Whole, inlined, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

OUTER, INNER = 0.2389942656229905, 0.7610057343770095
"""Of four pixels in a row under one of half the size: a Gaussian of 0.8 px over three pixels, averaged over two places."""


@piece
def brightness(picture: UInt8Array, row: Whole, column: Whole) -> np.float32:
    """Mean of the channels of a pixel."""
    total = np.int64(picture[row, column, 0]) + np.int64(picture[row, column, 1]) + np.int64(picture[row, column, 2])
    return np.float32(np.float64(total) / 3.0)


@kernel
def change_rows(
    first: Whole, last: Whole, picture: UInt8Array, known: BoolArray, across: Float32Array, along: Float32Array
) -> None:
    """Change of brightness from the left and from the upper neighbour, 0 where either is unknown, in rows [first, last)."""
    width = picture.shape[1]
    for row in range(first, last):
        for column in range(width):
            here, there = brightness(picture, row, column), known[row, column]
            across[row, column], along[row, column] = np.float32(0), np.float32(0)
            if column and there and known[row, column - 1]:
                across[row, column] = abs(here - brightness(picture, row, column - 1))
            if row and there and known[row - 1, column]:
                along[row, column] = abs(here - brightness(picture, row - 1, column))


@kernel
def describe_rows(
    first: Whole,
    last: Whole,
    picture: UInt8Array,
    across: Float32Array,
    along: Float32Array,
    share: Float32Array,
    weight: np.float32,
    known: BoolArray,
    out: Float32Array,
) -> None:
    """H x W x 5 `out` in known pixels: colours, and `weight` times both changes over the share that is known."""
    for row in range(first, last):
        for column in range(picture.shape[1]):
            if known[row, column]:
                for k in range(3):
                    out[row, column, k] = picture[row, column, k]
                out[row, column, 3] = weight * across[row, column] / share[row, column]
                out[row, column, 4] = weight * along[row, column] / share[row, column]


@inlined
def count_known(hole: BoolArray, row: Whole, column: Whole) -> Whole:
    """Known ones of the four pixels under one of half the size."""
    known = 0
    for y in range(2 * row, min(2 * row + 2, hole.shape[0])):
        for x in range(2 * column, min(2 * column + 2, hole.shape[1])):
            known += not hole[y, x]
    return known


@kernel
def halve_rows(
    first: Whole, last: Whole, values: Float32Array, hole: BoolArray, out: Float32Array, hole_out: BoolArray
) -> None:
    """Rows [first, last) at half the size, rounded up. A pixel is a hole if more than half under it is hole or beyond the border;
    its values (H x W x C) are means of what lies round it: of the known pixels, or in a hole of all."""
    height, width, channels = values.shape
    for row in range(first, last):
        for column in range(out.shape[1]):
            known = count_known(hole, row, column)
            hole_out[row, column] = known < 2
            total = 0.0
            for k in range(channels):
                out[row, column, k] = np.float32(0)
            for j in range(4):
                y = 2 * row - 1 + j
                for i in range(4):
                    x = 2 * column - 1 + i
                    if 0 <= y < height and 0 <= x < width and (known < 2 or not hole[y, x]):
                        down, right = INNER if 0 < j < 3 else OUTER, INNER if 0 < i < 3 else OUTER
                        weight = down * right
                        total += weight
                        for k in range(channels):
                            out[row, column, k] += np.float32(weight) * values[y, x, k]
            for k in range(channels):
                out[row, column, k] = np.float32(out[row, column, k] / total)
