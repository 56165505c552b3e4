"""Numba kernels of misaligned depth edges: inverse depth and colours in; inverse depth with edges aligned to the picture out."""

from __future__ import annotations

from dlama.geometry.kernels.jit import Flag, Real, Whole, inlined, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array

ROOM = 10
"""Numbers that `fit` needs of a row."""


@piece
def color_similarity(color: Float32Array, row: Whole, column: Whole, y: Whole, x: Whole, width: Real) -> Real:
    """1 for one and the same colour, 0 from `width` (levels, root of the sum over the channels) on."""
    red = color[y, x, 0] - color[row, column, 0]
    green = color[y, x, 1] - color[row, column, 1]
    blue = color[y, x, 2] - color[row, column, 2]
    return max(0.0, 1.0 - (red * red + green * green + blue * blue) / (width * width))


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


@kernel
def fit_planes(
    first: Whole,
    last: Whole,
    w: Float32Array,
    band: BoolArray,
    target: Float32Array,
    color: Float32Array,
    ratio: Real,
    radius: Whole,
    width: Real,
    room: Float32Array,
    out: Float32Array,
) -> None:
    """Where `target` is not 0, the inverse depth of the plane through known pixels near by that are as near as it, least squares.

    w: H x W, 0 = unknown; band: H x W, where w may be wrong: a pixel there counts a tenth; target: H x W; color: H x W x 3
    float32: pixels `width` levels apart do not count. ratio: relative step of one surface between neighbours; radius: px looked
    at; room: H x ROOM. out: H x W, elsewhere w.
    """
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
                    weight = color_similarity(color, row, column, y, x, width) * (1.0 if not band[y, x] else 0.1)
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
def sum_sides(
    w: Float32Array,
    rim: BoolArray,
    color: Float32Array,
    ratio: Real,
    radius: Whole,
    row: Whole,
    column: Whole,
    room: Float32Array,
) -> None:
    """Number and summed colours of the pixels within `radius` beyond the rim: of the own surface into room[row, :4], of nearer
    ones into room[row, 4:8]."""
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
def spread_along(
    w: Float32Array,
    rim: BoolArray,
    color: Float32Array,
    ratio: Real,
    radius: Whole,
    row: Whole,
    column: Whole,
    room: Float32Array,
) -> Real:
    """Sum of the squares of how far the own surface's colours are from their mean (room[row, 1:4]) along the way to the nearer
    side's (room[row, 5:8])."""
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
def find_mixed(
    first: Whole,
    last: Whole,
    w: Float32Array,
    rim: BoolArray,
    color: Float32Array,
    ratio: Real,
    radius: Whole,
    share: Real,
    contrast: Real,
    spreads: Real,
    room: Float32Array,
    out: BoolArray,
) -> None:
    """True at pixels behind the rim with at least a `share` of the nearer side's colour.

    rim: H x W, within RIM of an edge; contrast: least difference of the sides' mean colours in levels; spreads: least deviation
    from the own side's colour in standard deviations; other arguments as of `fit_planes`.
    """
    for row in range(first, last):
        for column in range(w.shape[1]):
            out[row, column] = False
            if not rim[row, column] or w[row, column] <= 0:
                continue
            sum_sides(w, rim, color, ratio, radius, row, column, room)
            if room[row, 0] < 3 or room[row, 4] < 3:
                continue
            for k in range(3):
                room[row, 1 + k] /= room[row, 0]
                room[row, 5 + k] = room[row, 5 + k] / room[row, 4] - room[row, 1 + k]
            apart = room[row, 5] ** 2 + room[row, 6] ** 2 + room[row, 7] ** 2
            if apart < contrast * contrast:
                continue
            along = 0.0
            for k in range(3):
                along += (color[row, column, k] - room[row, 1 + k]) * room[row, 5 + k]
            if along < share * apart:
                continue
            spread = spread_along(w, rim, color, ratio, radius, row, column, room)
            out[row, column] = along * along * room[row, 0] > spreads * spreads * spread
