"""Matched patches in; the mean of the patches over each hole pixel, and by how much they differ there, out (numba)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.patchmatch.kernels import HALF, Places, steps_inside

STRIDE = 2
"""Pixels between the patches that are copied in a picture larger than the level."""


class Votes(NamedTuple):
    """Matched patches over pixels of the hole."""

    pixels: Places
    """M x 2."""
    number: NDArray[np.int32]
    """H x W, of the patch round each pixel, else -1."""
    found: Places
    """N x 2, centres of their matches."""
    weights: Float32Array
    """N."""
    near: Float32Array
    """SIDE x SIDE weights by a centre's place next to the pixel."""


@kernel
def vote_rows(first: Whole, last: Whole, values: Float32Array, votes: Votes, out: Float32Array) -> None:
    """Set hole pixels [first, last) to a weighted mean of the patches over them. out: M x C."""
    pixels, number, found, weights, near = votes
    height, width, _ = values.shape
    for p in range(first, last):
        row, column = int(pixels[p, 0]), int(pixels[p, 1])
        top, bottom, left, right = steps_inside(row, column, height, width)
        total = a = b = c = d = e = np.float32(0)  # sums of the CHANNELS: in registers they take two thirds of the time
        for j in range(top, bottom + 1):
            for i in range(left, right + 1):
                t = int(number[row + j, column + i])
                if t >= 0:
                    weight = weights[t] * near[j + HALF, i + HALF]
                    total += weight
                    source_row, source_column = int(found[t, 0]) - j, int(found[t, 1]) - i
                    a += weight * values[source_row, source_column, 0]
                    b += weight * values[source_row, source_column, 1]
                    c += weight * values[source_row, source_column, 2]
                    d += weight * values[source_row, source_column, 3]
                    e += weight * values[source_row, source_column, 4]
        for k, channel in enumerate((a, b, c, d, e)):
            out[p, k] = channel / total


@kernel
def copy_rows(
    first: Whole,
    last: Whole,
    picture: UInt8Array,
    hole: BoolArray,
    votes: Votes,
    times: Whole,
    out: UInt8Array,
    spread: Float32Array,
) -> None:
    """As `vote_rows`, of the colours alone, from a picture (H x W x 3) so many `times` larger than the level whose matches they
    are. Where no patch is known `out` stays.

    out: H x W x 3; spread: M levels, the standard deviation of the colours that the patches over a pixel give it, all alike, mean
    over the channels."""
    pixels, number, found, weights, near = votes
    height, width, _ = picture.shape
    stride = min(times, STRIDE)
    for p in range(first, last):
        row, column = int(pixels[p, 0]), int(pixels[p, 1])
        top, bottom, left, right = steps_inside(row, column, height, width)
        total = a = b = c = np.float32(0)
        count = squares = reds = greens = blues = 0.0
        for j in range(top + -(row + top) % stride, bottom + 1, stride):
            for i in range(left + -(column + left) % stride, right + 1, stride):
                down, across = (row + j) // times, (column + i) // times
                t = int(number[down, across])
                if t < 0:
                    continue
                source_row = row + (int(found[t, 0]) - down) * times
                source_column = column + (int(found[t, 1]) - across) * times
                if hole[source_row, source_column]:
                    continue
                weight = weights[t] * near[j + HALF, i + HALF]
                total += weight
                red = np.float64(picture[source_row, source_column, 0])
                green = np.float64(picture[source_row, source_column, 1])
                blue = np.float64(picture[source_row, source_column, 2])
                a += weight * np.float32(red)
                b += weight * np.float32(green)
                c += weight * np.float32(blue)
                count += 1
                reds, greens, blues = reds + red, greens + green, blues + blue
                squares += red * red + green * green + blue * blue
        if total > 0:
            for k, channel in enumerate((a, b, c)):
                out[row, column, k] = np.uint8(channel / total + np.float32(0.5))
            variance = squares / count - (reds * reds + greens * greens + blues * blues) / (count * count)
            spread[p] = np.sqrt(max(variance, 0.0) / 3)
