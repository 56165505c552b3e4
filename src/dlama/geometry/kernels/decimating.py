"""Kernels of decimation: which triangles of a bintree over the pixel grid have to be halved to keep depth and picture.

The tree: squares of `size` pixels, each cut along a diagonal into two right triangles; a triangle is halved at the middle of its
longest side, again and again, until its legs are one pixel long. Diagonals lead to the centre of the next larger square, so the
two triangles at a longest side are halved together, and no crack opens (Evans, Kirkpatrick, Townsend: Right-Triangulated
Irregular Networks, 2001). `halved` is 1 at the middles where that is done, on a lattice that may reach beyond the picture: places
beyond stand for the nearest pixel of the last row or column, so that triangles there have no area.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from dlama.geometry.kernels.jit import Array, Flag, Pixel, Real, Whole, inlined, kernel, piece

DEPTH_METRES = 1e-3
"""Most that depth may be off in metres; or a `share` of it, or as `noise` of inverse depth (1/m) moves it, whichever is most."""
TINY = 1e-9


@piece
def ends(x0: Whole, y0: Whole, x1: Whole, y1: Whole, y: Whole, low: Real, high: Real) -> tuple[Real, Real]:
    """The span [low, high] of a row, widened by where an edge crosses it."""
    if y0 == y1 or y < min(y0, y1) or y > max(y0, y1):
        return low, high
    x = x0 + (x1 - x0) * (y - y0) / (y1 - y0)
    return min(low, x), max(high, x)


class Relief(NamedTuple):
    """Depth, and how far triangles may be off it."""

    depth: Array
    """H x W metres, 0 = none."""
    flat: Array
    """(H - 1) x (W - 1): 1 where the four pixels round a square are one surface, as larger triangles cover no others."""
    share: Real
    """Of the depth,"""
    noise: Real
    """and of inverse depth (1/m)."""


@piece
def fits(relief: Relief, x0: Whole, y0: Whole, x1: Whole, y1: Whole, x2: Whole, y2: Whole) -> Flag:
    """True if a triangle between three pixels lies on one surface and within the tolerances at each pixel that it covers: of its
    depth, and half a pixel in the picture, since textures are interpolated in space."""
    depth, flat, share, noise = relief
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if area == 0:
        return True
    z0, z1, z2 = float(depth[y0, x0]), float(depth[y1, x1]), float(depth[y2, x2])
    if not (z0 > 0 and z1 > 0 and z2 > 0):
        return False
    # inverse depth, and it times the pixel's offset from the first corner, are affine in the picture
    w0, w1, w2 = 1 / z0, 1 / z1, 1 / z2
    down1, down2, right1, right2 = y1 - y0, y2 - y0, x1 - x0, x2 - x0
    wx, wy = ((w1 - w0) * down2 - (w2 - w0) * down1) / area, ((w2 - w0) * right1 - (w1 - w0) * right2) / area
    ux, uy = (w1 * right1 * down2 - w2 * right2 * down1) / area, (w2 - w1) * right1 * right2 / area
    vx, vy = (w1 - w2) * down1 * down2 / area, (w2 * down2 * right1 - w1 * down1 * right2) / area
    before_low, before_high = math.inf, -math.inf
    top, bottom = min(y0, y1, y2), max(y0, y1, y2)
    for y in range(top, bottom + 1):
        low, high = ends(x0, y0, x1, y1, y, math.inf, -math.inf)
        low, high = ends(x1, y1, x2, y2, y, low, high)
        low, high = ends(x2, y2, x0, y0, y, low, high)
        if y > top:
            first = int(math.floor(min(low, before_low) + TINY))
            for x in range(first, int(math.ceil(max(high, before_high) - TINY))):
                if flat[y - 1, x] == 0:
                    return False
        before_low, before_high = low, high
        begin, wrong = int(math.ceil(low - TINY)), 0
        down, right = float(y - y0), float(begin - x0)
        w, u, v = w0 + wx * right + wy * down, ux * right + uy * down, vx * right + vy * down
        for step in range(int(math.floor(high + TINY)) + 1 - begin):
            z, here = float(depth[y, begin + step]), w + wx * step
            off_x, off_y = u + ux * step - (right + step) * here, v + vx * step - down * here
            far_off = off_x * off_x + off_y * off_y > 0.25 * here * here
            wrong += far_off | (abs(1 - here * z) > max(DEPTH_METRES, z * max(share, noise * z)) * here)
        if wrong > 0:
            return False
    return True


@piece
def fits_clamped(relief: Relief, x0: Whole, y0: Whole, x1: Whole, y1: Whole, x2: Whole, y2: Whole) -> Flag:
    """`fits`, of corners on the lattice."""
    right, bottom = relief.depth.shape[1] - 1, relief.depth.shape[0] - 1
    x0, x1, x2 = min(x0, right), min(x1, right), min(x2, right)
    return fits(relief, x0, min(y0, bottom), x1, min(y1, bottom), x2, min(y2, bottom))


@kernel
def halve_smallest(first: Whole, last: Whole, relief: Relief, halved: Array) -> None:
    """`halve` of sides of half 1 in the inside of the picture, where most of the work is: what `fits` says, in a few steps."""
    depth, flat, share, noise = relief
    for row in range(max(first, 1), min(last, depth.shape[0] - 1)):
        for column in range(1 + row % 2, depth.shape[1] - 1, 2):
            down, right = row % 2, 1 - row % 2
            z, one, other = (
                float(depth[row, column]),
                float(depth[row - down, column - right]),
                float(depth[row + down, column + right]),
            )
            around = flat[row, column] & flat[row - 1, column] & flat[row, column - 1] & flat[row - 1, column - 1]
            harmonic = 2 * one * other
            wrong = abs(harmonic - z * (one + other)) > max(DEPTH_METRES, z * max(share, noise * z)) * (one + other)
            halved[row, column] = 1 if (around == 0) | wrong else 0


@inlined
def is_halved(relief: Relief, halved: Array, at: Pixel, side: Pixel, apex: Pixel) -> Flag:
    """Whether the triangles at a middle (row, column) are halved: the middle of one of their other sides is, or one of the two
    does not fit.

    side, apex: rows and columns from there to an end of the longest side, and to an apex; the others lie opposite.
    """
    (y, x), (down, right), (apex_down, apex_right) = at, side, apex
    tall, wide = halved.shape
    for number in range(4 if (right + apex_right) % 2 == 0 else 0):  # none of the smallest triangles
        way, other = 2 * (number // 2) - 1, 2 * (number % 2) - 1
        sub_y, sub_x = y + way * (down + other * apex_down) // 2, x + way * (right + other * apex_right) // 2
        if 0 <= sub_y < tall and 0 <= sub_x < wide and halved[sub_y, sub_x] != 0:
            return True
    for way in range(-1, 2, 2):
        end_y, end_x = y + way * apex_down, x + way * apex_right
        inside = 0 <= end_y < tall and 0 <= end_x < wide
        if inside and not fits_clamped(relief, x - right, y - down, x + right, y + down, end_x, end_y):
            return True
    return False


@piece
def directions(row: Whole, column: Whole, half: Whole, centres: Flag) -> tuple[Pixel, Pixel]:
    """`side` and `apex` of `is_halved` for a row and a column of `halve`."""
    if centres:
        down = half if (row + column) % 2 == 0 else -half
        return (down, half), (-down, half)
    down = half * (row % 2)
    return (down, half - down), (half - down, down)


@kernel
def halve(first: Whole, last: Whole, relief: Relief, half: Whole, centres: Flag, halved: Array) -> None:
    """Middles of the sides of the squares of size 2 * half, in rows of `half` pixels, or their centres, in rows of squares: 1
    where the triangles there are halved. Those at a side lead to the centres of squares, those at a centre to two corners."""
    height, width = relief.depth.shape
    for row in range(first, last):
        y = (2 * row + 1) * half if centres else row * half
        for x in range(half if centres else half * (1 - row % 2), halved.shape[1], 2 * half):
            if half == 1 and not centres and 0 < x < width - 1 and 0 < y < height - 1:
                continue  # halve_smallest did it
            side, apex = directions(row, x // (2 * half), half, centres)
            halved[y, x] = 1 if is_halved(relief, halved, (y, x), side, apex) else 0
