"""Reading a picture between its pixels: colours and a place in them in; the colour there out (numba pieces).

Cubic B-spline interpolation inside a surface, bilinear next to its edges, so that nothing bleeds across them. Bilinear
everywhere blurs: on street frames turned by 10 degrees, LPIPS over what both cameras see is a third lower so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from dlama.geometry.kernels.drawing.rasterize import quad_sides
from dlama.geometry.kernels.jit import Real, Whole, in_bands, inlined, light_band, piece
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

Four = tuple[Real, Real, Real, Real]
"""Weights of four pixels."""

REACH = 6
"""Pixels to either side that the inverse filter reads; beyond, its weights are below 2e-4."""
WINDOW = 8
"""Rows and columns of one surface that a place needs round it: four are read; what lies beyond two more has half a level of
say in their coefficients at most."""
ZERO, SIXTH, HALF, TWO_THIRDS, ONE = (np.float32(number) for number in (0, 1 / 6, 1 / 2, 2 / 3, 1))
RED = np.int64(0)


def spline(color: UInt8Array) -> Float32Array:
    """H W 3 coefficients, flat, of the cubic B-spline that passes through every pixel's colour (Unser, Aldroubi, Eden 1993)."""
    inverse = math.sqrt(3) * (math.sqrt(3) - 2) ** np.abs(np.arange(-REACH, REACH + 1))
    inverse = (inverse / inverse.sum()).astype(np.float32)
    knots = np.empty(color.shape, np.float32)

    def filter_rows(first: int, last: int) -> None:
        upper, lower = max(first - REACH, 0), last + REACH
        rows = cv2.sepFilter2D(color[upper:lower], cv2.CV_32F, inverse, inverse, borderType=cv2.BORDER_REFLECT_101)
        knots[first:last] = rows[first - upper : last - upper]

    in_bands(filter_rows, len(color), band=light_band(color.shape[1]))
    return knots.ravel()


def whole_quads(joined: UInt8Array) -> BoolArray:
    """(H-1) x (W-1), True where all four sides of the quad whose upper left pixel this is are joined."""
    return (joined[:-1, :-1] == 3) & (joined[:-1, 1:] >= 2) & ((joined[1:, :-1] & 1) > 0)


def smooth_quads(joined: UInt8Array) -> UInt8Array:
    """H x W, 1 where the WINDOW x WINDOW pixels round the quad whose upper left one this is are one surface."""

    smooth = np.zeros(joined.shape, np.uint8)
    if min(joined.shape) > 1:
        whole = whole_quads(joined).view(np.uint8)
        smooth[:-1, :-1] = erode(whole, WINDOW - 1, WINDOW // 2 - 1)
    return smooth


def far_blocks(far: BoolArray, fine: bool) -> UInt8Array:
    """H x W, 1 where the 2 x 2 pixels whose upper left one this is are far, 2 where the WINDOW x WINDOW round them are (if
    fine), 0 else."""
    code = far.view(np.uint8)
    blocks = erode(code, 2, 0)
    return blocks + erode(code, WINDOW, WINDOW // 2 - 1) if fine else blocks


def erode(mask: UInt8Array, size: int, before: int) -> UInt8Array:
    """1 where the size x size pixels, `before` of them above and left of this one, are all 1 and inside the picture."""
    around = np.ones((size, size), np.uint8)
    kept = cv2.erode(mask, around, anchor=(before, before), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return np.asarray(kept, np.uint8)


@piece
def cubic(t: Real) -> Four:
    """Weights of the pixels at -1, 0, 1, 2 for a place t in 0 .. 1 after pixel 0: the cubic B-spline."""
    rest = ONE - t
    first, last = rest * rest * rest * SIXTH, t * t * t * SIXTH
    second = TWO_THIRDS - t * t * (ONE - t * HALF)
    return first, second, ONE - first - second - last, last


@inlined
def four_in_a_row(knots: Float32Array, at: np.uintp, along: Four) -> Real:
    """One channel of four pixels, weighted; at: its flat place in the first, unsigned, for that is not checked for its sign."""
    second, third, last = at + np.uintp(3), at + np.uintp(6), at + np.uintp(9)
    return along[0] * knots[at] + along[1] * knots[second] + along[2] * knots[third] + along[3] * knots[last]


@inlined
def four_by_four(knots: Float32Array, at: np.uintp, row: np.uintp, along: Four, down: Four) -> Real:
    """One channel of 4 x 4 pixels, weighted; row: the flat step to the next one."""
    third = at + row + row
    upper = down[0] * four_in_a_row(knots, at, along) + down[1] * four_in_a_row(knots, at + row, along)
    return upper + (down[2] * four_in_a_row(knots, third, along) + down[3] * four_in_a_row(knots, third + row, along))


@inlined
def smooth_color(
    knots: Float32Array, width: Whole, upper: Whole, left: Whole, fu: Real, fv: Real
) -> tuple[Real, Real, Real]:
    """Red, green and blue (float, may overshoot) at (fu, fv) in 0 .. 1 after the pixel (upper, left).

    knots: `spline`; width: pixels of its rows.
    """
    row, red = np.uintp(3 * width), np.uintp(3 * ((upper - 1) * width + left - 1))
    along, down = cubic(fu), cubic(fv)
    green, blue = red + np.uintp(1), red + np.uintp(2)
    return (
        four_by_four(knots, red, row, along, down),
        four_by_four(knots, green, row, along, down),
        four_by_four(knots, blue, row, along, down),
    )


@inlined
def bilinear_channel(color: UInt8Array, upper: Whole, left: Whole, channel: Whole, weights: Four) -> Real:
    """One channel of a quad's pixels, weighted."""
    lower, right = upper + 1, left + 1
    return (
        weights[0] * color[upper, left, channel]
        + weights[1] * color[upper, right, channel]
        + weights[2] * color[lower, left, channel]
        + weights[3] * color[lower, right, channel]
    )


@inlined
def bilinear(color: UInt8Array, upper: Whole, left: Whole, weights: Four) -> tuple[Real, Real, Real]:
    """Red, green and blue of a quad's pixels at the weights of the upper left, upper right, lower left, lower right one."""
    red = bilinear_channel(color, upper, left, RED, weights)
    green = bilinear_channel(color, upper, left, RED + 1, weights)
    return red, green, bilinear_channel(color, upper, left, RED + 2, weights)


@piece
def at_pixel(color: UInt8Array, row: Whole, column: Whole) -> tuple[Real, Real, Real]:
    """Red, green and blue of one pixel."""
    return np.float32(color[row, column, 0]), np.float32(color[row, column, 1]), np.float32(color[row, column, 2])


class MeshColors(NamedTuple):
    """The colours of a mesh."""

    joined: UInt8Array
    """Which neighbours are joined (`mesh_grid`)."""
    smooth: UInt8Array
    """Where colours are read by splines (`smooth_quads`)."""
    color: UInt8Array
    """H x W x 3."""
    knots: Float32Array
    """Of the splines (`spline`)."""


@inlined
def surface_color(su: Real, sv: Real, colors: MeshColors) -> tuple[Real, Real, Real]:
    """Colour at source column, row (0 = the first pixel's centre) of a mesh, never across its edges.

    Next to an edge: bilinear, where a corner that is cut off (two sides unjoined) counts nothing; the nearest pixel where
    none is joined.
    """
    joined, color = colors.joined, colors.color
    height, width = joined.shape
    left, upper = np.int64(su), np.int64(sv)
    fu, fv = su - np.float32(left), sv - np.float32(upper)  # int64 - float32 would be float64
    if left >= width - 1 or upper >= height - 1 or (fu < 1e-3 and fv < 1e-3):
        return at_pixel(color, upper + (fv > HALF), left + (fu > HALF))
    if colors.smooth[upper, left]:
        return smooth_color(colors.knots, width, upper, left, fu, fv)
    sides = quad_sides(joined, upper, left)
    a = (ONE - fu) * (ONE - fv) if sides & 3 else ZERO
    b = fu * (ONE - fv) if sides & 5 else ZERO
    c = (ONE - fu) * fv if sides & 10 else ZERO
    d = fu * fv if sides & 12 else ZERO
    total = a + b + c + d
    if total <= 1e-6:
        return at_pixel(color, upper + (fv > HALF), left + (fu > HALF))
    return bilinear(color, upper, left, (a / total, b / total, c / total, d / total))


@piece
def level(value: Real) -> np.uint8:
    """A colour as uint8: the nearest level in 0 .. 255."""
    nearest = np.int64(value + HALF)
    return np.uint8(0 if nearest < 0 else (255 if nearest > 255 else nearest))
