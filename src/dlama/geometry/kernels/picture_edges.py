"""Numba kernels of misaligned depth edges: inverse depth and colours in; inverse depth with edges aligned to the picture out."""

from __future__ import annotations

from typing import NamedTuple

from dlama.geometry.kernels.jit import Flag, Real, Whole, inlined, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array

ROOM = 10
"""Numbers that `fit` needs of a row."""
UNLIKE = 60.0
"""Colour difference (root of the sum over channels) from which two colours have no similarity."""
MIXED, CONTRAST, SPREADS = 0.3, 40.0, 2.0
"""Of mixed pixels, the least share of the other side; the least colour difference of the sides (root of the sum over channels);
the least deviation from their own side, in standard deviations."""


@piece
def color_similarity(color: Float32Array, row: Whole, column: Whole, y: Whole, x: Whole) -> Real:
    """1 for one and the same colour, 0 from UNLIKE on."""
    red = color[y, x, 0] - color[row, column, 0]
    green = color[y, x, 1] - color[row, column, 1]
    blue = color[y, x, 2] - color[row, column, 2]
    return max(0.0, 1.0 - (red * red + green * green + blue * blue) / (UNLIKE * UNLIKE))


@piece
def fit(room: Float32Array, row: Whole, otherwise: Real) -> Real:
    """Value at (0, 0) of the plane with the weighted sums room[row] = (1, x, y, xx, xy, yy, w, wx, wy), least squares."""
    n, x, y = room[row, 0], room[row, 1], room[row, 2]
    xx, xy, yy = room[row, 3] + 0.5 * n, room[row, 4], room[row, 5] + 0.5 * n
    w, wx, wy = room[row, 6], room[row, 7], room[row, 8]
    determinant = n * (xx * yy - xy * xy) - x * (x * yy - xy * y) + y * (x * xy - xx * y)
    if determinant <= 1e-9:
        return otherwise
    return (w * (xx * yy - xy * xy) - x * (wx * yy - xy * wy) + y * (wx * xy - xx * wy)) / determinant


class Edges(NamedTuple):
    """The surroundings of depth edges."""

    w: Float32Array
    """H x W inverse depth, 0 = unknown."""
    rim: BoolArray
    """H x W, near an edge, where w or the colour may be wrong."""
    color: Float32Array
    """H x W x 3 levels."""
    ratio: Real
    """Relative step of one surface between neighbours."""
    radius: Whole
    """px looked at."""


@kernel
def fit_planes(
    first: Whole, last: Whole, edges: Edges, target: Float32Array, room: Float32Array, out: Float32Array
) -> None:
    """Where `target` is not 0, the inverse depth of the plane through known pixels near by that are as near as it, least squares.

    A pixel at the rim counts a tenth, one whose colour is UNLIKE nothing. target: H x W; room: H x ROOM. out: H x W, elsewhere w.
    """
    w, band, color, ratio, radius = edges
    rows, columns = w.shape
    for row in range(first, last):
        for column in range(columns):
            out[row, column] = w[row, column]
            best = target[row, column]
            if best <= 0:
                continue
            for k in range(9):
                room[row, k] = 0
            for y in range(max(0, row - radius), min(rows, row + radius + 1)):
                for x in range(max(0, column - radius), min(columns, column + radius + 1)):
                    there = w[y, x]
                    if there <= 0 or abs(there - best) > ratio * (2.0 + radius) * best:
                        continue
                    weight = color_similarity(color, row, column, y, x) * (1.0 if not band[y, x] else 0.1)
                    right, down = float(x - column), float(y - row)
                    room[row, 0] += weight
                    room[row, 1] += weight * right
                    room[row, 2] += weight * down
                    room[row, 3] += weight * right * right
                    room[row, 4] += weight * right * down
                    room[row, 5] += weight * down * down
                    room[row, 6] += weight * there
                    room[row, 7] += weight * there * right
                    room[row, 8] += weight * there * down
            near = ratio * (2.0 + radius) * best
            out[row, column] = min(max(fit(room, row, best * 1.0), best - near), best + near)


@piece
def is_one_surface(one: Real, other: Real, ratio: Real, down: Real, right: Real) -> Flag:
    """Whether two pixels so many rows and columns apart may lie on one surface; ratio: step of inverse depth of neighbours."""
    away = float(max(abs(down), abs(right)))
    return abs(one - other) <= ratio * (2.0 + away) * max(one, other)


@inlined
def sum_sides(edges: Edges, row: Whole, column: Whole, room: Float32Array) -> None:
    """Number and summed colours of the pixels within the radius beyond the rim: of the own surface into room[row, :4], of nearer
    ones into room[row, 4:8]."""
    w, rim, color, ratio, radius = edges
    here = w[row, column]
    for k in range(8):
        room[row, k] = 0
    for y in range(max(0, row - radius), min(w.shape[0], row + radius + 1)):
        for x in range(max(0, column - radius), min(w.shape[1], column + radius + 1)):
            there = w[y, x]
            if rim[y, x] or there <= 0:
                continue
            same = is_one_surface(there, here, ratio, y - row, x - column)
            if there < here and not same:
                continue
            side = 0 if same else 4
            room[row, side] += 1
            for k in range(3):
                room[row, side + 1 + k] += color[y, x, k]


@inlined
def spread_along(edges: Edges, row: Whole, column: Whole, room: Float32Array) -> Real:
    """Sum of the squares of how far the own surface's colours are from their mean (room[row, 1:4]) along the way to the nearer
    side's (room[row, 5:8])."""
    w, rim, color, ratio, radius = edges
    spread = 0.0
    for y in range(max(0, row - radius), min(w.shape[0], row + radius + 1)):
        for x in range(max(0, column - radius), min(w.shape[1], column + radius + 1)):
            if rim[y, x] or not is_one_surface(w[y, x], w[row, column], ratio, y - row, x - column):
                continue
            one = 0.0
            for k in range(3):
                one += (color[y, x, k] - room[row, 1 + k]) * room[row, 5 + k]
            spread += one * one
    return spread


@kernel
def find_mixed(first: Whole, last: Whole, edges: Edges, room: Float32Array, out: BoolArray) -> None:
    """True at pixels behind the rim with at least a share of MIXED of the nearer side's colour. room: H x ROOM."""
    w, rim, color = edges.w, edges.rim, edges.color
    for row in range(first, last):
        for column in range(w.shape[1]):
            out[row, column] = False
            if not rim[row, column] or w[row, column] <= 0:
                continue
            sum_sides(edges, row, column, room)
            if room[row, 0] < 3 or room[row, 4] < 3:
                continue
            for k in range(3):
                room[row, 1 + k] /= room[row, 0]
                room[row, 5 + k] = room[row, 5 + k] / room[row, 4] - room[row, 1 + k]
            apart = room[row, 5] ** 2 + room[row, 6] ** 2 + room[row, 7] ** 2
            if apart < CONTRAST * CONTRAST:
                continue
            along = 0.0
            for k in range(3):
                along += (color[row, column, k] - room[row, 1 + k]) * room[row, 5 + k]
            if along < MIXED * apart:
                continue
            spread = spread_along(edges, row, column, room)
            out[row, column] = along * along * room[row, 0] > SPREADS * SPREADS * spread
