"""Numba kernels of maps and their pictures: a joint median, which sharpens edges, and the joint upsampling of a map."""

from __future__ import annotations

import numpy as np

from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.jit import Flag, Real, Whole, inlined, kernel, piece
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


@piece
def leads_to(own: Whole, other: Whole, top: Flag, bottom: Flag, before: Flag, after: Flag) -> Flag:
    """Whether joints lead from one pixel of a quad to another (0, 1 above, 2, 3 below); top, bottom: of the two above, of the two
    below; before, after: of the two on the left, of the two on the right."""
    level, upright = (top if own < 2 else bottom), (before if own % 2 == 0 else after)
    other_level, other_upright = (bottom if own < 2 else top), (after if own % 2 == 0 else before)
    if other == own:
        return True
    if other == own ^ 1:
        return level or (upright and other_level and other_upright)
    if other == own ^ 2:
        return upright or (level and other_upright and other_level)
    return (level and other_upright) or (upright and other_level)


@kernel
def upsample_joined(
    first: Whole,
    last: Whole,
    w: Float32Array,
    joined: UInt8Array,
    small_color: UInt8Array,
    color: UInt8Array,
    alike: Float32Array,
    least_near: Real,
    room: Float32Array,
    out: Float32Array,
) -> None:
    """Rows [first, last) of `out` (H x W metres, 0 = missing, inf = far): each pixel lies on the surface of one of the four map
    pixels round it, the one that is near and of like colour, and is interpolated among those of the four that are on it.

    w: h x w inverse depth, 0 = far, below 0 = missing; joined: h x w, RIGHT and DOWN of each pixel
    that lies on one surface with that neighbour; small_color: h x w x 3, the picture at the map's size;
    color: H x W x 3; alike: weight by squared colour difference, the last one of all greater ones, too; least_near: added to the
    weights by distance, so that a pixel of unlike colour may be left; room: H x 2 x 4, scratch.
    """
    rows, columns = w.shape
    height, width = out.shape
    most = len(alike) - 1
    for row in range(first, last):
        near, score = room[row, 0], room[row, 1]
        y = (row + 0.5) * rows / height - 0.5
        upper = min(max(int(np.floor(y)), 0), max(rows - 2, 0))
        lower, down = min(upper + 1, rows - 1), np.float32(min(max(y - upper, 0.0), 1.0))
        for column in range(width):
            x = (column + 0.5) * columns / width - 0.5
            left = min(max(int(np.floor(x)), 0), max(columns - 2, 0))
            right, across = min(left + 1, columns - 1), np.float32(min(max(x - left, 0.0), 1.0))
            near[0], near[1] = (1 - down) * (1 - across), (1 - down) * across
            near[2], near[3] = down * (1 - across), down * across
            nearest = 0
            for k in range(1, 4):
                if near[k] > near[nearest]:
                    nearest = k
            if w[lower if nearest >= 2 else upper, right if nearest % 2 else left] < 0:
                out[row, column] = 0
                continue
            top, bottom = joined[upper, left] & RIGHT > 0, joined[lower, left] & RIGHT > 0
            before, after = joined[upper, left] & DOWN > 0, joined[upper, right] & DOWN > 0
            if top and bottom and before and after:
                value = near[0] * w[upper, left] + near[1] * w[upper, right]
                value += near[2] * w[lower, left] + near[3] * w[lower, right]
                out[row, column] = np.float32(1) / value if value > 0 else np.float32(np.inf)
                continue
            own = 0
            for k in range(4):
                at_y, at_x = lower if k >= 2 else upper, right if k % 2 else left
                unlike = color_difference(color, row, column, small_color, at_y, at_x)
                score[k] = (near[k] + least_near) * alike[min(unlike, most)] if w[at_y, at_x] >= 0 else -1
                if score[k] > score[own]:
                    own = k
            sums, weights = np.float32(0), np.float32(0)
            for k in range(4):
                if leads_to(own, k, top, bottom, before, after):
                    sums += near[k] * w[lower if k >= 2 else upper, right if k % 2 else left]
                    weights += near[k]
            value = w[lower if own >= 2 else upper, right if own % 2 else left]
            if weights > 1e-3:
                value = sums / weights
            out[row, column] = np.float32(1) / value if value > 0 else np.float32(np.inf)
