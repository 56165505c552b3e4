"""Numba kernels that extend surfaces into holes: far-side interpolation, and belief propagation over surface labels."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Flag, Pixel, Real, Whole, in_bands, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

DIRECTIONS = 16


@piece
def first_known(
    w: Float32Array, apart: Float32Array, row: Whole, column: Whole, dr: Real, dc: Real
) -> tuple[Real, Real]:
    """Inverse depth and distance of the first known pixel from a hole pixel in a direction; -1 if there is none.

    apart: H x W, rows or columns to the nearest known pixel, whichever are more: so many steps meet none.
    """
    height, width = w.shape
    steps, y, x = 0.0, row + 0.5, column + 0.5
    free = np.float64(apart[row, column])
    while free > 0:
        y += free * dr
        x += free * dc
        steps += free
        if not (0 <= y < height and 0 <= x < width):
            return -1.0, 0.0
        r, c = np.int64(y), np.int64(x)
        free = np.float64(apart[r, c])
    return np.float64(w[r, c]), steps


@piece
def far_mean(room: Float64Array, line: Whole, count: Whole) -> Real:
    """Mean of the first `count` values of a line near their weighted first quartile, with squared weights. room: values and
    weights, 2 x lines x numbers."""
    total = 0.0
    for number in range(count):
        total += room[1, line, number]
    reached, limit, taken = 0.0, 0.0, 0
    while reached < 0.25 * total:  # the smallest one that was not taken yet, and so on
        smallest, which = np.inf, 0
        for number in range(count):
            if not taken >> number & 1 and room[0, line, number] < smallest:
                smallest, which = room[0, line, number], number
        taken |= 1 << which
        reached += room[1, line, which]
        limit = smallest
    top, bottom = 0.0, 0.0
    for number in range(count):
        if room[0, line, number] <= 1.3 * limit:
            square = room[1, line, number] * room[1, line, number]
            top += room[0, line, number] * square
            bottom += square
    return top / bottom


@kernel
def far_side_rows(
    first: Whole,
    last: Whole,
    w: Float32Array,
    apart: Float32Array,
    ways: Float64Array,
    room: Float64Array,
    out: Float32Array,
) -> None:
    """Rows of `far_side`. apart: as of `first_known`; ways: directions x 2, a step's rows and columns; room: 2 x H x
    directions."""
    for row in range(first, last):
        for column in range(w.shape[1]):
            if apart[row, column] == 0:
                continue
            count = np.int64(0)
            for way in range(len(ways)):
                value, distance = first_known(w, apart, row, column, ways[way, 0], ways[way, 1])
                if value > 0:
                    room[0, row, count] = value
                    room[1, row, count] = 1.0 / distance
                    count += 1
            if count > 0:
                out[row, column] = far_mean(room, row, count)


def far_side(w: Float32Array, hole: BoolArray) -> Float32Array:
    """Inverse depth of the holes interpolated from the far side of their rims only; 0 where no rim is in sight.

    From each hole pixel 16 rays sample the rim. The farthest quarter of the samples (weighted by nearness) and all within 30 %
    of it count, by inverse square distance. Far pixels (w = 0) are left out: the sky has its own label.
    """
    angles = [2 * math.pi * direction / DIRECTIONS for direction in range(DIRECTIONS)]
    ways = np.array([(math.sin(angle), math.cos(angle)) for angle in angles])
    room, out = np.empty((2, len(w), DIRECTIONS)), np.zeros(w.shape, np.float32)
    apart = cv2.distanceTransform(hole.view(np.uint8), cv2.DIST_C, 3)
    in_bands(far_side_rows, len(w), np.ascontiguousarray(w), apart, ways, room, out, band=16)
    return out


@piece
def pair_cost(value: Real, other: Real, potts: Real) -> Real:
    """Cost between two different labels of neighbouring hole pixels: `potts` where their surfaces meet, 1 more at a jump
    of 10 % and above."""
    larger = value if value > other else other
    larger = larger if larger > 1e-9 else 1e-9
    step = abs(value - other)
    if step > 0.11 * larger:  # most are: no division for them
        return potts + 1.0
    jump = step / larger / 0.1
    return potts + (jump if jump < 1 else 1.0)


class Field(NamedTuple):
    """Labels of pixels and their messages."""

    unary: Float32Array
    """H x W x L costs."""
    messages: Float32Array
    """4 x H x W x L: from left, right, above and below."""
    values: Float32Array
    """H x W x L inverse depth."""
    potts: Real
    """Cost of a border."""


class Room(NamedTuple):
    """Room to work, of each line."""

    belief: Float64Array
    """2 x lines x L."""
    cheap: NDArray[np.int64]
    """lines x L."""


@piece
def send(field: Field, room: Room, line: Whole, here: Pixel, there: Pixel, incoming: Whole, outgoing: Whole) -> Flag:
    """One min-sum message from a hole pixel to its neighbour, and whether it changed; `incoming` is the direction it must not
    echo."""
    unary, messages, values, potts = field
    belief, cheap = room
    row, column = here
    to_row, to_column = there
    count = unary.shape[2]
    one, two, three = np.int64(incoming == 0), 1 + np.int64(incoming <= 1), 2 + np.int64(incoming <= 2)  # the others
    least = np.inf
    for k in range(count):
        total = np.float64(unary[row, column, k])
        total += messages[one, row, column, k]
        total += messages[two, row, column, k]
        total += messages[three, row, column, k]
        belief[0, line, k] = total
        least = total if total < least else least
    dearest = least + (potts + 1.0)  # any label can be reached from the cheapest one at this cost
    rivals = 0
    for k in range(count):
        if belief[0, line, k] + potts < dearest:
            cheap[line, rivals] = k
            rivals += 1
    smallest = np.inf
    for k in range(count):
        best = belief[0, line, k] if belief[0, line, k] < dearest else dearest
        for rival in range(rivals):
            other = cheap[line, rival]
            if other != k and belief[0, line, other] + potts < best:  # a border costs `potts` at least
                cost = pair_cost(values[row, column, other], values[to_row, to_column, k], potts)
                cost += belief[0, line, other]
                best = cost if cost < best else best
        belief[1, line, k] = np.float32(best)
        smallest = best if best < smallest else smallest
    changed = False
    for k in range(count):
        message = np.float32(belief[1, line, k] - smallest)
        changed = changed or message != messages[outgoing, to_row, to_column, k]
        messages[outgoing, to_row, to_column, k] = message
    return changed


@kernel
def sweep(
    first: Whole,
    last: Whole,
    across: Whole,
    field: Field,
    hole: BoolArray,
    stale: UInt8Array,
    room: Room,
) -> None:
    """Messages there and back along each row (across = 1: directions 0 from left, 1 from right) or column (2 from above, 3 from
    below); lines first..last only, which do not meet. stale: H x W, bits of the messages to be sent, those whose own messages
    changed."""
    length = hole.shape[1] if across else hole.shape[0]
    base = 0 if across else 2
    for back in range(2):
        incoming, outgoing = base + 1 - back, base + back
        for step in range(length - 1):
            at = length - 1 - step if back else step
            to = at - 1 if back else at + 1
            for line in range(first, last):  # neighbours in memory along columns, and independent of each other
                here, there = ((line, at), (line, to)) if across else ((at, line), (to, line))
                if stale[here] >> outgoing & 1 and hole[here] and hole[there]:
                    stale[here] ^= 1 << outgoing
                    if send(field, room, line, here, there, incoming, outgoing):
                        stale[there] |= 15 ^ (1 << incoming)


def beliefs(unary: Float32Array, values: Float32Array, hole: BoolArray, potts: float, rounds: int) -> Float32Array:
    """H x W x L min-marginals by loopy belief propagation (sequential sweeps along rows and columns). values: L x H x W."""
    messages, values = np.zeros((4, *unary.shape), np.float32), np.ascontiguousarray(values.transpose(1, 2, 0))
    lines, labels = max(hole.shape), unary.shape[2]
    field, stale = Field(unary, messages, values, potts), np.full(hole.shape, 15, np.uint8)
    room = Room(np.empty((2, lines, labels)), np.empty((lines, labels), np.int64))
    for _ in range(rounds):
        for across in (1, 0):
            in_bands(sweep, hole.shape[1 - across], across, field, hole, stale, room)
    return np.asarray(unary + messages.sum(0))
