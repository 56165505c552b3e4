"""Numba kernels of depth edges: a grid of inverse depths in; which pixels fly, and which neighbours are one surface, out.

`w` is inverse depth (1/m), 0 = no vertex: it is affine in pixels on a plane, so steps in it tell an edge from a slope. It has a
margin of PAD zeros all round: pixel (row, column) is w[row + PAD, column + PAD], and no index needs a check.
Loaded only when something renders.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dlama.geometry.kernels.jit import Flag, Real, Whole, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

RIGHT = 1
DOWN = 2
PAD = 3


def inverse_with_margin(depth: Float32Array, hole: BoolArray) -> Float32Array:
    """(H + 2 PAD) x (W + 2 PAD) inverse depth of the known pixels, 0 in holes, far pixels and the margin."""
    height, width = depth.shape
    w = np.zeros((height + 2 * PAD, width + 2 * PAD), np.float32)
    np.divide(np.float32(1), depth, out=w[PAD:-PAD, PAD:-PAD], where=(depth > 0) & ~hole)
    return w


@piece
def is_slope(w: Float32Array, r: Whole, c: Whole, dr: Whole, dc: Whole) -> Flag:
    """True if the steep step from w[r, c] to w[r + dr, c + dc] continues a slope.

    An inclined plane is affine in inverse depth, an edge is not. One neighbouring slope is not enough (a single mixed pixel
    makes two equal steps), two on one side or one on each are.
    """
    w0, w1 = w[r, c], w[r + dr, c + dc]
    if w0 <= 0 or w1 <= 0:
        return False
    step = w1 - w0
    tolerance = 0.2 * abs(step)
    behind, ahead = w[r - dr, c - dc], w[r + 2 * dr, c + 2 * dc]
    before = behind > 0 and abs(w0 - behind - step) <= tolerance
    after = ahead > 0 and abs(ahead - w1 - step) <= tolerance
    if before == after:
        return before
    if before:
        beyond = w[r - 2 * dr, c - 2 * dc]
        return beyond > 0 and abs(behind - beyond - step) <= tolerance
    beyond = w[r + 3 * dr, c + 3 * dc]
    return beyond > 0 and abs(beyond - ahead - step) <= tolerance


class Grid(NamedTuple):
    """Inverse depth, and which steps of it between neighbours are one surface."""

    w: Float32Array
    """With its margin."""
    ratio: Real
    """Steps up to this share of the larger inverse depth,"""
    least: Real
    """or up to this (1/m), the noise, if that is more."""


@kernel
def join(first: Whole, last: Whole, grid: Grid, out: UInt8Array) -> None:
    """uint8 H x W: bit RIGHT / DOWN set where a vertex is joined to its right / lower neighbour, by a slope or a small step."""
    w, ratio, least = grid
    surely = np.float32(ratio * 0.99999)  # a quick look in single precision first: few pixels need the exact one
    for row in range(first, last):
        r = row + PAD
        for column in range(out.shape[1]):
            here, right, down = w[r, column + PAD], w[r, column + 4], w[r + 1, column + PAD]
            flat = (abs(right - here) <= surely * max(right, here)) & (abs(down - here) <= surely * max(down, here))
            out[row, column] = 3 if (here > 0) & flat else 0
        for column in range(out.shape[1]):
            here, flags = w[r, column + PAD], 0
            if out[row, column] == 3 or here <= 0:
                continue
            for way in range(2):  # one call of is_slope in a loop: every other one would be compiled again
                other = w[r + way, column + 4 - way]
                within = abs(other - here) <= least and other > 0
                if (
                    within
                    or abs(other - here) <= ratio * max(other, here)
                    or is_slope(w, r, column + PAD, way, 1 - way)
                ):
                    flags |= DOWN if way else RIGHT
            out[row, column] = flags


@piece
def lies_between(here: Real, one: Real, other: Real, share: Real, least: Real) -> Flag:
    """True if `here` is between both neighbours, and further from each than surfaces are joined over."""
    low, high = min(one, other), max(one, other)
    return (low > 0) & (low < here * share) & (here < high * share) & (low < here - least) & (here < high - least)


@kernel
def reject_flying(
    first: Whole,
    last: Whole,
    grid: Grid,
    depth: Float32Array,
    hole: BoolArray,
    out_depth: Float32Array,
    out_flying: BoolArray,
) -> None:
    """Vertices strictly between two surfaces along a row or a column, joined to neither: marked, and left out of the depth.

    depth: H x W metres; out_depth: the same without holes and flying pixels (0).
    """
    w, ratio, least = grid
    roughly = np.float32((1 - ratio) * 1.00001)
    for row in range(first, last):
        r = row + PAD
        for column in range(depth.shape[1]):
            c, here = column + PAD, w[r, column + PAD]
            across = lies_between(here, w[r, c - 1], w[r, c + 1], roughly, least)
            out_flying[row, column] = across | lies_between(here, w[r - 1, c], w[r + 1, c], roughly, least)
            out_depth[row, column] = np.float32(0) if hole[row, column] else depth[row, column]
        for column in range(depth.shape[1]):
            if not out_flying[row, column]:
                continue
            c, here = column + PAD, w[r, column + PAD]
            out_flying[row, column] = False
            for way in range(2):
                r0, c0 = r - way, c - 1 + way
                if not lies_between(here, w[r0, c0], w[r + way, c + 1 - way], 1 - ratio, least):
                    continue
                if is_slope(w, r0, c0, way, 1 - way) or is_slope(w, r, c, way, 1 - way):
                    continue
                out_flying[row, column] = True
                out_depth[row, column] = 0
