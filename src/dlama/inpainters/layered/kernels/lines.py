"""Line kernels: known surfaces on a grid and a direction in each plane in; the extent of the plane along it out (numba)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Real, Whole, inlined, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array

CLEAR = 3
"""Majority of nearest known cells on a line, on the plane or behind it, that decides."""
SAME = 1.06
"""Largest ratio of inverse depths of cells on the plane: doors, sills and panes are."""


class Cells(NamedTuple):
    """What lines run over."""

    w: Float32Array
    """h x w inverse depth of known cells."""
    label: NDArray[np.int8]
    hole: BoolArray
    past: BoolArray
    """K x h x w, the hole cells in which a source camera saw the sky through each plane."""
    away: Float32Array
    """K x h x w distance to known cells, or such, in cells."""


class Directions(NamedTuple):
    """Planes, and where their lines go."""

    planes: Float64Array
    """K x 3 (a, b, c), w = a x + b y + c over cells."""
    towards: Float64Array
    """K x 3, homogeneous vanishing point of each plane's lines."""
    followed: BoolArray
    """K, the planes that are looked for."""
    horizon: Real
    """Inverse depth (1/m) at which planes end."""


class Found(NamedTuple):
    """K x h' x w', of each queried cell; as `follow_line` gives them."""

    first: Float32Array
    length: Float32Array
    ways: NDArray[np.int8]
    """In how many of the two ways along the line the plane is seen."""


@inlined
def shown_at(cells: Cells, own: Whole, r: Whole, c: Whole, value: Real) -> Whole:
    """What a cell shows of a plane of inverse depth `value` there: 1 the plane, -1 what is behind it, 0 neither: something stands
    before the plane, which may continue behind it, or another one meets it."""
    known = np.float64(0.0 if cells.hole[r, c] else cells.w[r, c])
    if known > SAME * value:
        return 0
    if known * SAME < value:
        return -1
    return 0 if cells.label[r, c] > 0 and cells.label[r, c] != own else 1


@piece
def follow_line(
    cells: Cells, directions: Directions, number: Whole, row: Real, column: Real, dr: Real, dc: Real
) -> tuple[Real, Real]:
    """(first, length): cells to plane `number` along a line, and the length over which it is seen. Length 0: the line looks
    behind it; first -1: undecided."""
    hole, past, away = cells.hole, cells.past, cells.away
    plane, own = directions.planes[number], number + 1
    height, width = hole.shape
    y, x = np.float64(row), np.float64(column)
    jump = 1.0
    first, start, on, behind, gone, verdict, steps = -1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    while True:
        size = jump if jump > 1.0 else 1.0
        y += dr * size
        x += dc * size
        steps += size
        r, c = np.int64(math.floor(y + 0.5)), np.int64(math.floor(x + 0.5))
        value = plane[0] * x + plane[1] * y + plane[2]
        if r < 0 or c < 0 or r >= height or c >= width or value <= directions.horizon:
            break
        if hole[r, c] and not past[own - 1, r, c]:
            jump = np.float64(away[own - 1, r, c]) - 1.5
            continue
        jump = 1.0
        shown = shown_at(cells, own, r, c, value)
        if shown == 0:
            continue
        if start < 0:
            start = steps
        if shown < 0:
            behind += 1.0
            gone += 1.0
        else:
            if first < 0:
                first = steps
            on += 1.0
            gone = 0.0
        if verdict == 0 and abs(on - behind) >= CLEAR:
            verdict = 1.0 if on > behind else -1.0
        if verdict < 0 or (verdict > 0 and gone >= 4):  # so many cells behind the plane: it has ended
            break
    if verdict > 0:
        return first, on
    return (start, 0.0) if verdict < 0 else (-1.0, 0.0)


@kernel
def line_rows(
    begin: Whole,
    end: Whole,
    directions: Directions,
    cells: Cells,
    asking: BoolArray,
    stride: Whole,
    out: Found,
) -> None:
    """Rows of `seen_on_lines` (depth/out_of_view). asking: h x w, cells of which every stride-th is queried."""
    planes, towards, followed, horizon = directions
    first, length, ways = out
    for row in range(begin, end):
        for column in range(first.shape[2]):
            y, x = row * stride, column * stride
            if not asking[y, x]:
                continue
            for k in range(len(planes)):
                if not followed[k] or planes[k, 0] * x + planes[k, 1] * y + planes[k, 2] <= horizon:
                    continue
                dc, dr = towards[k, 0] - towards[k, 2] * x, towards[k, 1] - towards[k, 2] * y
                size = math.sqrt(dc * dc + dr * dr)
                if size < 1e-9:
                    continue
                dc, dr = dc / size, dr / size
                for _way in range(2):
                    found, seen = follow_line(cells, directions, k, y, x, dr, dc)
                    if seen > 0:
                        ways[k, row, column] += 1
                    if found > 0 and (first[k, row, column] < 0 or found < first[k, row, column]):
                        first[k, row, column] = found
                        length[k, row, column] = seen
                    dc, dr = -dc, -dr
