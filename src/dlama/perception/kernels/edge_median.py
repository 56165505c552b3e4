"""Numba kernels of a joint median: a map, its reliable pixels and the picture in; the map with sharp edges out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.kernels.jit import Real, Whole, inlined, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

MOST = 256
"""Most voters of one pixel: a window of 15 x 15."""


@piece
def weighted_median(
    value: Float32Array, weight: Float32Array, begin: Whole, end: Whole, above: Real, total: Real
) -> Real:
    """The largest of the values [begin, end) whose weight, with `above` and that of all above it, reaches half the total;
    writes over both arrays.

    By quickselect: of a span that holds the median the part is kept that does, larger or smaller than the middle one of three of
    its values.
    """
    while True:
        one, two, three = value[begin], value[(begin + end) // 2], value[end - 1]
        pivot, of_larger, of_same = max(min(one, two), min(max(one, two), three)), 0.0, 0.0
        for at in range(begin, end):  # without branches, of which half would be foreseen badly
            of_larger += weight[at] * np.float32(value[at] > pivot)
            of_same += weight[at] * np.float32(value[at] == pivot)
        is_larger, last = above + of_larger >= 0.5 * total, begin
        if not is_larger:
            above += of_larger + of_same
        if not is_larger and above >= 0.5 * total:
            return pivot
        for at in range(begin, end):
            here = value[at]
            value[last], weight[last] = here, weight[at]
            last += here > pivot if is_larger else here < pivot
        if last == begin:
            return pivot
        end = last


@kernel
def joint_median(
    first: Whole,
    last: Whole,
    values: Float32Array,
    blurred: BoolArray,
    votes: BoolArray,
    color: UInt8Array,
    radius: Whole,
    step: Whole,
    alike: Float32Array,
    near: Float32Array,
    room: Float32Array,
    out: Float32Array,
) -> None:
    """At `blurred` pixels the weighted median of the voters around, weighted by distance and colour difference.

    values: float32 H x W. blurred, votes: bool H x W. color: H x W x 3. radius, step: px of the window and of its grid.
    alike: weight of a voter by its squared colour difference, the last one of all greater ones, too; near: N x N, by its place
    in the window, N x N of at most MOST. room: float32 H x 2 x MOST, scratch. out: float32 H x W, as `values` elsewhere.
    """
    height, width = values.shape
    side, most = len(near), len(alike) - 1
    for row in range(first, last):
        for column in range(width):
            out[row, column] = values[row, column]
            if not blurred[row, column]:
                continue
            # voters are split by a value near the median while they are read: from `smaller` on those up to it
            guess = out[row, column - step] if column >= step and blurred[row, column - step] else values[row, column]
            larger, smaller, above, total = 0, MOST, 0.0, 0.0
            value, weight = room[row, 0], room[row, 1]
            for j in range(side):
                y = row + step * j - radius
                if y < 0 or y >= height:
                    continue
                for i in range(side):
                    x = column + step * i - radius
                    if x < 0 or x >= width or not votes[y, x]:
                        continue
                    unlike = color_difference(color, row, column, color, y, x)
                    here, w = values[y, x], near[j, i] * alike[min(unlike, most)]
                    total += w
                    if here > guess:
                        value[larger], weight[larger] = here, w
                        above, larger = above + w, larger + 1
                    else:
                        smaller -= 1
                        value[smaller], weight[smaller] = here, w
            if total > 1e-12:
                if above >= 0.5 * total:
                    out[row, column] = weighted_median(value, weight, 0, larger, 0.0, total)
                else:
                    out[row, column] = weighted_median(value, weight, smaller, MOST, above, total)


@kernel
def take_most_alike(
    first: Whole,
    last: Whole,
    color: UInt8Array,
    small_color: UInt8Array,
    small: Float32Array,
    changed: BoolArray,
    out: Float32Array,
) -> None:
    """Rows [first, last) of a map (H x W), `changed` in a smaller size (h x w): there each pixel takes, of the nine values
    round its place, that whose colour is most like its own.

    color: H x W x 3; small_color, small: of the smaller size.
    """
    height, width = out.shape
    rows, columns = small.shape
    for row in range(first, last):
        y = int((row + 0.5) * rows / height)
        for column in range(width):
            x = int((column + 0.5) * columns / width)
            if not changed[y, x]:
                continue
            least = 4 * 255 * 255
            for place in range(9):  # the middle one first
                there = (place + 4) % 9
                near_y = min(max(y + there // 3 - 1, 0), rows - 1)
                near_x = min(max(x + there % 3 - 1, 0), columns - 1)
                off = color_difference(color, row, column, small_color, near_y, near_x)
                if off < least:
                    least, out[row, column] = off, small[near_y, near_x]


@inlined
def color_difference(color: UInt8Array, row: Whole, column: Whole, other: UInt8Array, y: Whole, x: Whole) -> int:
    """Squared difference of a pixel's colour from that of (y, x) in another picture, in levels, summed over the channels."""
    unlike: Whole = 0
    for channel in range(3):
        apart = np.int64(color[row, column, channel]) - np.int64(other[y, x, channel])
        unlike += apart * apart
    return int(unlike)
