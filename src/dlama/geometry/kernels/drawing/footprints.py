"""The rim of a mesh in; footprints of its vertices, one source pixel each, drawn into the z-buffer out (numba).

At its rim the mesh ends at pixel centres, half a pixel short: wires, poles, silhouettes and isolated pixels would be too thin.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.drawing.chunks import Vertices
from dlama.geometry.kernels.drawing.rasterize import ZBuffer
from dlama.geometry.kernels.drawing.sampling import whole_quads
from dlama.geometry.kernels.jit import Real, Whole, kernel, piece
from dlama.geometry.rgbd import Float32Array, UInt8Array


def rim(joined: UInt8Array, depth: Float32Array) -> NDArray[np.int64]:
    """Flat indices of vertices round which some quad is not whole."""
    whole = np.zeros((joined.shape[0] + 1, joined.shape[1] + 1), np.bool_)
    whole[1:-1, 1:-1] = whole_quads(joined)
    inner = whole[:-1, :-1] & whole[:-1, 1:] & whole[1:, :-1] & whole[1:, 1:]
    return np.flatnonzero(~inner & (depth > 0))


@piece
def steepness(vertices: Vertices, joined: UInt8Array, row: Whole, column: Whole) -> Real:
    """How steep the surface round a vertex is (relative step in w to a joined neighbour), -1 if it is seen from behind."""
    x, y, w = vertices.x, vertices.y, vertices.w
    height, width = joined.shape
    steepest, facing = 0.0, 0.0
    here = w[row, column]
    dr, dc = 0, 1
    for _ in range(4):
        r, c = row + dr, column + dc
        # the neighbour a quarter turn on: right -> down -> left -> up
        r2, c2 = row + dc, column - dr
        side, side2 = (RIGHT, DOWN) if dr == 0 else (DOWN, RIGHT)
        dr, dc = dc, -dr
        if not (0 <= r < height and 0 <= c < width) or w[r, c] <= 0:
            continue
        if not joined[min(row, r), min(column, c)] & side:
            continue
        steepest = max(steepest, abs(w[r, c] / here - 1))
        if not (0 <= r2 < height and 0 <= c2 < width) or w[r2, c2] <= 0:
            continue
        if joined[min(row, r2), min(column, c2)] & side2:
            facing += (x[r, c] - x[row, column]) * (y[r2, c2] - y[row, column])
            facing -= (x[r2, c2] - x[row, column]) * (y[r, c] - y[row, column])
    return -1.0 if facing < 0 else steepest


@kernel
def draw_rim(
    vertices: Vertices,
    joined: UInt8Array,
    rim: NDArray[np.int64],
    depth: Float32Array,
    zoom: Real,
    meshed: Float32Array,
    out: ZBuffer,
) -> None:
    """Footprints of the vertices at the rim of the mesh (N flat source indices).

    depth: source z; zoom: target focal length / source focal length; meshed: w of `out` as the mesh left it. A footprint is the
    source pixel's own size, at least one target pixel and at most 32. It only covers what is empty, or behind the surface it
    belongs to.
    """
    width = depth.shape[1]
    rows, columns = out.w.shape
    for number in range(len(rim)):
        row, column = rim[number] // width, rim[number] % width
        inverse, px, py = vertices.w[row, column], vertices.x[row, column], vertices.y[row, column]
        half = min(16.0, 0.5 * zoom * depth[row, column] * inverse)
        if not (inverse > 0 and -half - 1 < px < columns + half + 1 and -half - 1 < py < rows + half + 1):
            continue
        steepest = steepness(vertices, joined, row, column)
        if steepest < 0:
            continue
        if half <= 0.5:
            left = right = math.floor(px)
            upper = lower = math.floor(py)
        else:
            left, right = math.ceil(px - half - 0.5), math.ceil(px + half - 0.5) - 1
            upper, lower = math.ceil(py - half - 0.5), math.ceil(py + half - 0.5) - 1
        for ty in range(max(0, upper), min(rows - 1, lower) + 1):
            for tx in range(max(0, left), min(columns - 1, right) + 1):
                if inverse > out.w[ty, tx] and inverse > meshed[ty, tx] * (1.02 + 2 * steepest):
                    out.w[ty, tx] = inverse
                    out.where[ty, tx, 0] = column
                    out.where[ty, tx, 1] = row
