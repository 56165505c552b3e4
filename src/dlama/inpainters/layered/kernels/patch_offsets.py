"""Texture kernels: pixel grids in; shift scores, chosen shifts and painted pixels out (numba).

A *shift* (s1, s2) is a 3D translation within a plane; it moves a homogeneous pixel of inverse depth w to
p'_h = p_h + w (s1 E1 + s2 E2), with E = K e for two directions e of the plane.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import BAND, Flag, Real, Whole, in_bands, inlined, kernel, piece
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.inpainters.layered.kernels.cells import NEARER, Sources, bilinear_neighbours, blend, sample

FARTHER = np.float32(0.9)
"""Ratio of inverse depths below which a source is what lies behind the surface."""


@piece
def displace(u: Real, v: Real, w: Real, s1: Real, s2: Real, axes: Float64Array) -> tuple[Real, Real, Real]:
    """(u', v', z'): the shifted pixel, and the factor on its distance (z' <= 0: behind the camera)."""
    z = 1 + w * (s1 * axes[0, 2] + s2 * axes[1, 2])
    x = u + w * (s1 * axes[0, 0] + s2 * axes[1, 0])
    y = v + w * (s1 * axes[0, 1] + s2 * axes[1, 1])
    inv = 1 / z if z > 1e-3 else 0.0
    return x * inv, y * inv, z


@piece
def is_source(u: Real, v: Real, expected: Real, sources: Sources) -> Flag:
    """Is the cell under full-resolution pixel (u, v) a trusted source of this surface at the expected inverse depth?"""
    factor, label = sources.cell_size, sources.cell_label
    x, y = np.int64(np.floor(u / factor)), np.int64(np.floor(v / factor))
    if x < 0 or y < 0 or x >= label.shape[1] or y >= label.shape[0] or label[y, x] != sources.label:
        return False
    w = sources.inverse_depth[y, x]
    return FARTHER * expected - 1e-6 <= w <= NEARER * expected + 1e-6


@kernel
def correlate_rows(
    first: Whole,
    last: Whole,
    shifts: Float64Array,
    points: Float32Array,
    here: Float64Array,
    detail: Float32Array,
    sources: Sources,
    need: Whole,
    room: Float32Array,
    out: Float32Array,
) -> None:
    """Shifts first..last of `correlate`. points: 3 x N, u, v in cells and inverse depth; here: N x 3, the detail there; sources:
    their axes in cells; room: bands x 3 x N, to work in."""
    depths, label, kind, axes = sources.inverse_depth, sources.cell_label, sources.label, sources.axes
    rows, cols = label.shape
    one, least, slack, band = np.float32(1), np.float32(1e-3), np.float32(1e-6), first // BAND
    for i in range(first, last):
        du = np.float32(shifts[i, 0] * axes[0, 0] + shifts[i, 1] * axes[1, 0])
        dv = np.float32(shifts[i, 0] * axes[0, 1] + shifts[i, 1] * axes[1, 1])
        dz = np.float32(shifts[i, 0] * axes[0, 2] + shifts[i, 1] * axes[1, 2])
        for p in range(points.shape[1]):  # all of them, in vector instructions: most are no sources
            w = points[2, p]
            z = one + w * dz
            near = one / z if z > least else -one
            room[band, 0, p] = (points[0, p] + w * du) * near
            room[band, 1, p] = (points[1, p] + w * dv) * near
            room[band, 2, p] = w * near
        ab, aa, bb, n = 0.0, 1e-3, 1e-3, 0
        for p in range(points.shape[1]):
            x, y, expected = room[band, 0, p], room[band, 1, p], room[band, 2, p]
            if x < 0 or y < 0 or x >= cols or y >= rows or label[np.int64(y), np.int64(x)] != kind:
                continue
            w = depths[np.int64(y), np.int64(x)]
            if w < FARTHER * expected - slack or w > NEARER * expected + slack:
                continue
            n += 1
            across = bilinear_neighbours(np.float64(x), cols)
            along = bilinear_neighbours(np.float64(y), rows)
            for k in range(3):
                a, b = here[p, k], blend(detail, across, along, k)
                ab += a * b
                aa += a * a
                bb += b * b
        if n >= need:
            out[i] = ab / np.sqrt(aa * bb) * n / (n + 12.0)


def correlate(
    shifts: NDArray[np.float64],
    points: NDArray[np.float64],
    detail: Float32Array,
    sources: Sources,
    need: int,
) -> Float32Array:
    """Correlation of the detail (cells x 3) at sample points and at their shifted places; 0 where too few are known.

    points: N x 3 (u, v, inverse depth), full-resolution pixels. Shrunk towards 0 for few samples.
    """
    factor = sources.cell_size
    out, in_cells = np.zeros(len(shifts), np.float32), np.array([1 / factor, 1 / factor, 1])
    room = np.empty((-(-len(shifts) // BAND), 3, len(points)), np.float32)
    here = sample(detail, points[:, 0] / factor, points[:, 1] / factor)
    places = np.ascontiguousarray((points * in_cells).T, np.float32)
    sources = sources._replace(axes=sources.axes * in_cells)
    in_bands(correlate_rows, len(shifts), shifts, places, here, detail, sources, need, room, out)
    return out


@kernel
def scale_rows(
    first: Whole, last: Whole, shifts: Float64Array, cells: Float64Array, sources: Sources, out: Float32Array
) -> None:
    """Shifts first..last of `change_of_scale`."""
    for i in range(first, last):
        for p in range(len(cells)):
            w = cells[p, 2]
            x, y, z = displace(cells[p, 0], cells[p, 1], w, shifts[i, 0], shifts[i, 1], sources.axes)
            if z > 1e-3 and is_source(x, y, w / z, sources):
                octaves = np.log2(z)
                out[i, p] = abs(octaves) + (0.3 * (octaves if octaves > 0 else 0.0))


def change_of_scale(
    shifts: NDArray[np.float64],
    cells: NDArray[np.float64],
    sources: Sources,
) -> Float32Array:
    """For each shift and hole cell (u, v, w): -1 if its source is not known, else |log2| of the change of scale."""
    out = np.full((len(shifts), len(cells)), -1, np.float32)
    in_bands(scale_rows, len(shifts), shifts, cells, sources, out, band=8)
    return out


class Choices(NamedTuple):
    """Shifts that hole cells may have, and the one that each has."""

    cost: Float32Array
    """Cells x shifts (>= 1e6: impossible)."""
    lateral: Float32Array
    """Cells x shifts x 3, the colour detail of each shift."""
    chosen: NDArray[np.int32]
    """Cells, -1 = none."""


@inlined
def with_seam(total: Real, choices: Choices, p: Whole, i: Whole, q: Whole, seam: Real) -> Real:
    """The cost of shift i for cell p, and that of the seam to its neighbour q as that was chosen."""
    cost, lateral, chosen = choices
    j = chosen[q]
    if j < 0 or j == i:
        return total
    total += 0.15
    if cost[q, i] >= 1e6 or cost[p, j] >= 1e6:
        return total + 0.3
    gap = 0.0
    for k in range(3):
        gap += abs(lateral[p, i, k] - lateral[p, j, k]) + abs(lateral[q, i, k] - lateral[q, j, k])
    return total + seam * gap


@kernel
def assign_cells(
    index: NDArray[np.int32], choices: Choices, order: NDArray[np.int64], seam: Real, sweeps: Whole
) -> None:
    """Choose one shift per hole cell: unary cost plus seams to the neighbours' choices (ordered fill, then sweeps).

    index: rows x cols, cell number or -1 (not a hole cell of this surface). choices: nothing is chosen before, and after it where
    nothing is possible.
    """
    rows, cols = index.shape
    number, many = choices.cost.shape
    for sweep in range(sweeps):
        for o in range(number):
            cell = order[o] if sweep % 2 == 0 else order[number - 1 - o]
            y, x = cell // cols, cell % cols
            p = index[y, x]
            best, least = -1, 1e6
            for i in range(many):
                total = np.float64(choices.cost[p, i])
                if total >= least:
                    continue
                for d in range(4):
                    yy = y + (d == 0) - (d == 1)
                    xx = x + (d == 2) - (d == 3)
                    if 0 <= yy < rows and 0 <= xx < cols and index[yy, xx] >= 0:
                        total = with_seam(total, choices, p, i, index[yy, xx], seam)
                if total < least:
                    best, least = i, total
            choices.chosen[p] = best


class Paint(NamedTuple):
    """What the hole is painted with; grids of rows x cols cells."""

    color: UInt8Array
    """H x W x 3, the picture that is copied."""
    fine: Float32Array
    """rows x cols x 3, colours true to the rim,"""
    smooth: Float32Array
    """and very smooth ones."""
    cell: Whole
    """Pixels of a cell."""
    pick: NDArray[np.int32]
    """rows x cols, shift or -1."""
    gains: Float32Array
    """rows x cols x 3, weights of the fine band, the middle band and the copied colour."""
    shifts: Float64Array
    """N x 2."""


@kernel
def paint_pixels(
    first: Whole,
    last: Whole,
    pixels: NDArray[np.int64],
    sources: Sources,
    paint: Paint,
    added: Float64Array,
    out: UInt8Array,
) -> None:
    """Colour the flat pixels first..last of a list in `out`, feathered between the shifts of neighbouring cells. sources: pixels;
    added: N x 3 zeros, room to work."""
    color, fine, smooth, cell, pick, gains, shifts = paint
    height, width = sources.inverse_depth.shape
    rows, cols = pick.shape
    for n in range(first, last):
        y, x = pixels[n] // width, pixels[n] % width
        u, v, w = x + 0.5, y + 0.5, np.float64(sources.inverse_depth[y, x])
        gu, gv = u / cell, v / cell
        x0, y0 = np.int64(np.floor(gu - 0.5)), np.int64(np.floor(gv - 0.5))
        ax, ay = gu - 0.5 - x0, gv - 0.5 - y0
        across, along, total = bilinear_neighbours(gu, cols), bilinear_neighbours(gv, rows), 0.0
        for d in range(4):
            cx, cy = x0 + (d & 1), y0 + (d >> 1)
            share = (ax if d & 1 else 1 - ax) * (ay if d >> 1 else 1 - ay)
            if share <= 0 or cx < 0 or cy < 0 or cx >= cols or cy >= rows or pick[cy, cx] < 0:
                continue
            i = pick[cy, cx]
            su, sv, z = displace(u, v, w, shifts[i, 0], shifts[i, 1], sources.axes)
            if z <= 1e-3 or not is_source(su, sv, w / z, sources):
                continue
            total += share
            there_x, there_y = bilinear_neighbours(su / cell, cols), bilinear_neighbours(sv / cell, rows)
            pixel_x, pixel_y = bilinear_neighbours(su, width), bilinear_neighbours(sv, height)
            for k in range(3):
                base, copied = blend(fine, across, along, k), blend(color, pixel_x, pixel_y, k)
                low = blend(fine, there_x, there_y, k)
                middle = low - blend(smooth, there_x, there_y, k)
                middle += blend(smooth, across, along, k) - base
                banded = gains[cy, cx, 0] * (copied - low) + gains[cy, cx, 1] * middle
                added[n, k] += share * (banded + gains[cy, cx, 2] * (copied - base - banded))
        for k in range(3):
            value = blend(fine, across, along, k) + (added[n, k] / total if total > 0 else 0.0) + 0.5
            out[y, x, k] = np.uint8(0.0 if value < 0 else (255.0 if value > 255 else value))
