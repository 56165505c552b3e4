"""PatchMatch kernels: target and source patches in; the most similar source of each target, and the mean of the patches over each
hole pixel, out (numba)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Real, Whole, inlined, kernel, piece
from dlama.geometry.kernels.vectors import squared_difference
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

HALF = 3
"""Patches are squares of 2 HALF + 1 pixels."""
SIDE, CHANNELS = 7, 5
"""A row of a patch has SIDE CHANNELS numbers: the RUN of `squared_difference`."""
NEIGHBOURS = 8
"""Neighbours whose match is propagated: four adjacent, four up to LEAP pixels away."""
LEAP = 6
MOST_USED = 5.0
"""Uses of a source beyond which its penalty is constant."""
STRIDE = 2
"""Pixels between the patches that are copied in a picture larger than the level."""

Places = NDArray[np.int32]
"""N x 2: rows and columns."""


class Patches(NamedTuple):
    """A described picture with a hole, and its patches by their centres."""

    values: Float32Array
    """H x W x CHANNELS."""
    targets: Places
    """N x 2, those that touch the hole."""
    number: NDArray[np.int32]
    """H x W, of each target, else -1."""
    is_source: BoolArray
    """H x W, True = wholly known."""


class Penalties(NamedTuple):
    """What a match costs besides its differences."""

    weights: Float32Array
    """4: of distance, per px^2 along rows and columns; of each use of the source; of another surface."""
    used: Float32Array
    """H x W, how often a source is used."""
    label: NDArray[np.integer]
    """H x W, surfaces."""


class Matches(NamedTuple):
    """The source of each target."""

    found: Places
    """N x 2."""
    cost: Float32Array
    """N."""


class Steps(NamedTuple):
    """Random steps of a round."""

    random: NDArray[np.float64]
    """K x 2 in -1 .. 1."""
    start: Whole
    """From where on they are read."""
    reach: Real
    """px of the first one."""


@piece
def steps_inside(row: Whole, column: Whole, height: Whole, width: Whole) -> tuple[Whole, Whole, Whole, Whole]:
    """First and last step in rows, and in columns, from the centre of a patch that stays in the picture."""
    return max(-HALF, -row), min(HALF, height - 1 - row), max(-HALF, -column), min(HALF, width - 1 - column)


@inlined
def difference(
    values: Float32Array, row: Whole, column: Whole, source_row: Whole, source_column: Whole, limit: Real
) -> Real:
    """Mean over the patch round (row, column) of squared differences, summed over channels; `limit` or more is not exact.

    What lies beyond the border is left out; the source's patch is whole.
    """
    height, width, channels = values.shape
    total = 0.0
    if HALF <= row < height - HALF and HALF <= column < width - HALF:
        most = limit * SIDE * SIDE
        at = ((row - HALF) * width + column - HALF) * CHANNELS
        other = ((source_row - HALF) * width + source_column - HALF) * CHANNELS
        for _ in range(SIDE):
            total += float(squared_difference(values, np.uintp(at), np.uintp(other)))
            if total >= most:
                break
            at, other = at + width * CHANNELS, other + width * CHANNELS
        return total / (SIDE * SIDE)
    top, bottom, left, right = steps_inside(row, column, height, width)
    pixels = (bottom - top + 1) * (right - left + 1)
    for j in range(top, bottom + 1):
        for i in range(left, right + 1):
            for k in range(channels):
                step = np.float64(values[row + j, column + i, k]) - values[source_row + j, source_column + i, k]
                total += step * step
        if total >= limit * pixels:
            break
    return total / pixels


@piece
def distance_penalty(row: Whole, column: Whole, source_row: Whole, source_column: Whole, weights: Float32Array) -> Real:
    """Penalty of a patch for its distance (weights: per px^2, along rows and columns)."""
    down, across = np.float64(source_row - row), np.float64(source_column - column)
    return weights[0] * down * down + weights[1] * across * across


@piece
def penalty(row: Whole, column: Whole, source_row: Whole, source_column: Whole, penalties: Penalties) -> Real:
    """Penalty of a patch: for its distance, for its use, and where its centre lies on another surface."""
    weights, used, label = penalties
    again = min(max(np.float64(used[source_row, source_column]) - 1.0, 0.0), MOST_USED)
    other = weights[3] if label[row, column] != label[source_row, source_column] else 0.0
    return distance_penalty(row, column, source_row, source_column, weights) + weights[2] * again + other


@inlined
def match_of_neighbour(
    row: int, column: int, q: int, leap: int, number: NDArray[np.int32], now: Places
) -> tuple[int, int]:
    """Row and column of the source that continues the match of a target's neighbour, `leap` pixels away in direction q % 4;
    -1, -1 where that is no target."""
    down = leap if q % 4 == 0 else (-leap if q % 4 == 1 else 0)
    across = leap if q % 4 == 2 else (-leap if q % 4 == 3 else 0)
    other_row, other_column = row + down, column + across
    inside = 0 <= other_row < number.shape[0] and 0 <= other_column < number.shape[1]
    neighbour = int(number[other_row, other_column]) if inside else -1
    if neighbour < 0:
        return -1, -1
    return int(now[neighbour, 0]) - down, int(now[neighbour, 1]) - across


@kernel
def match_rows(
    first: Whole,
    last: Whole,
    patches: Patches,
    penalties: Penalties,
    steps: Steps,
    now: Places,
    out: Matches,
) -> None:
    """One round of PatchMatch for targets [first, last): propagation from neighbours, then random search with a shrinking
    radius.

    After Barnes et al., "PatchMatch" (2009); neighbours are read from the previous round, so bands are independent. now: N x 2,
    of the previous round; out: of this one, in place.
    """
    random, (height, width) = steps.random, patches.is_source.shape
    for t in range(first, last):
        row, column = int(patches.targets[t, 0]), int(patches.targets[t, 1])
        best_row, best_column = int(now[t, 0]), int(now[t, 1])
        least, compared = np.float64(out.cost[t]), False  # whether the best one was: neighbours mostly name it again
        draw = (t * 7919 + steps.start) % len(random)
        radius = steps.reach
        q = 0
        while q < NEIGHBOURS or radius >= 1:
            if q < NEIGHBOURS:
                leap = 1 if q < 4 else 1 + int(abs(random[draw, 0]) * LEAP)
                source_row, source_column = match_of_neighbour(row, column, q, leap, patches.number, now)
            else:
                source_row = best_row + int(random[draw, 0] * radius)
                source_column = best_column + int(random[draw, 1] * radius)
                radius = radius * 0.5
            q += 1
            draw = draw + 1 if draw + 1 < len(random) else 0
            if source_row < 0 or source_column < 0 or source_row >= height or source_column >= width:
                continue
            if source_row == best_row and source_column == best_column:
                if compared:
                    continue
                compared = True
            if distance_penalty(row, column, source_row, source_column, penalties.weights) >= least:
                continue
            if not patches.is_source[source_row, source_column]:
                continue
            more = penalty(row, column, source_row, source_column, penalties)
            if more >= least:
                continue
            value = more + difference(patches.values, row, column, source_row, source_column, least - more)
            if value < least:
                best_row, best_column, least, compared = source_row, source_column, value, True
        out.found[t, 0], out.found[t, 1], out.cost[t] = best_row, best_column, least


@kernel
def cost_rows(first: Whole, last: Whole, patches: Patches, penalties: Penalties, out: Matches) -> None:
    """What targets [first, last) cost with their matches, after the values have changed."""
    for t in range(first, last):
        row, column = int(patches.targets[t, 0]), int(patches.targets[t, 1])
        source_row, source_column = int(out.found[t, 0]), int(out.found[t, 1])
        more = penalty(row, column, source_row, source_column, penalties)
        out.cost[t] = more + difference(patches.values, row, column, source_row, source_column, np.inf)


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
