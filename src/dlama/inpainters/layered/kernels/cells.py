"""Cell kernels: a picture in; its trusted pixels, its means over cells, and smooth colours spread from those, out (numba)."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Array, Real, Whole, as_input, in_bands, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

Labels = NDArray[np.int8]
UNTRUSTED = -2
"""Label of pixels without a surface's own colour: holes, and pixels next to a nearer surface, whose colour may be mixed."""
NEARER = np.float32(1.04)
"""Ratio of inverse depths beyond which a source is an occluder."""
NON_PLANAR_NEARER = np.float32(1.2)
"""The same within non-planar objects (leaves), whose depth varies."""


@kernel
def trusted_rows(
    first: Whole,
    last: Whole,
    inverse_depth: Float32Array,
    label: Labels,
    reach: Whole,
    nearest: Float32Array,
    out: BoolArray,
) -> None:
    """Rows of `trusted_sources`. nearest: H x W, the largest inverse depth within `reach`, infinite where a hole is."""
    height, width = out.shape
    for y in range(first, last):
        for x in range(width):
            if nearest[y, x] == np.inf:
                continue
            kind, good = label[y, x], True
            own = inverse_depth[y, x] * NEARER + 1e-6
            if nearest[y, x] <= own:
                out[y, x] = True
                continue
            rough = inverse_depth[y, x] * NON_PLANAR_NEARER + 1e-6
            for j in range(max(0, y - reach), min(height, y + reach + 1)):
                for i in range(max(0, x - reach), min(width, x + reach + 1)):
                    nearer = inverse_depth[j, i] > (own if label[j, i] != kind else rough)
                    if nearer and (label[j, i] != kind or kind < 0):
                        good = False
                if not good:
                    break
            out[y, x] = good


def trusted_sources(hole: BoolArray, inverse_depth: Float32Array, label: Labels, reach: int) -> BoolArray:
    """Known pixels with their surface's own colour: no hole and no nearer surface within `reach` px."""
    square, out = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8), np.zeros(hole.shape, np.bool_)
    nearest = cv2.dilate(np.where(hole, np.float32(np.inf), inverse_depth), square)
    in_bands(trusted_rows, len(hole), inverse_depth, label, reach, nearest, out)
    return out


class Cells(NamedTuple):
    """A picture, or its means over cells."""

    color: Array
    """H x W x 3, of trusted pixels."""
    inverse_depth: Float32Array
    """H x W, 1/m; 0 = sky."""
    label: Labels
    """H x W: -1 non-planar, 0 sky, k >= 1 the k-th plane; UNTRUSTED where no surface's own colour is known."""


@kernel
def shrink_rows(first: Whole, last: Whole, picture: Cells, factor: Whole, out: Cells) -> None:
    """Rows of the cells of `shrink`."""
    color, inverse_depth, source = picture
    height, width = source.shape
    for r in range(first, last):
        for c in range(out.label.shape[1]):
            y1, x1 = min(height, (r + 1) * factor), min(width, (c + 1) * factor)
            red, green, blue, w, n, kind = 0.0, 0.0, 0.0, 0.0, 0, UNTRUSTED
            mixed = False
            for y in range(r * factor, y1):
                for x in range(c * factor, x1):
                    if source[y, x] == UNTRUSTED:
                        continue
                    mixed = mixed or (n > 0 and source[y, x] != kind)
                    kind = source[y, x]
                    red += color[y, x, 0]
                    green += color[y, x, 1]
                    blue += color[y, x, 2]
                    w += inverse_depth[y, x]
                    n += 1
            if n > 0 and not mixed and 2 * n >= (y1 - r * factor) * (x1 - c * factor):
                out.color[r, c, 0], out.color[r, c, 1], out.color[r, c, 2] = red / n, green / n, blue / n
                out.inverse_depth[r, c] = w / n
                out.label[r, c] = kind


def shrink(color: UInt8Array, inverse_depth: Float32Array, label: Labels, factor: int) -> Cells:
    """Cells of factor x factor pixels: mean colour and inverse depth of the trusted pixels, and their label.

    label: H x W of trusted pixels, UNTRUSTED elsewhere. A cell is UNTRUSTED where labels mix or most of its pixels are.
    """
    grid = tuple((size + factor - 1) // factor for size in label.shape)
    out = Cells(np.zeros((*grid, 3), np.float32), np.zeros(grid, np.float32), np.full(grid, UNTRUSTED, np.int8))
    in_bands(shrink_rows, grid[0], Cells(as_input(color), inverse_depth, label), factor, out)
    return out


def pull(sums: Float32Array, weights: Float32Array) -> tuple[Float32Array, Float32Array]:
    """The next coarser grid: sums over 2 x 2 cells."""
    down, right = (size % 2 for size in weights.shape)
    if down or right:
        edges = 0, down, 0, right, cv2.BORDER_CONSTANT
        sums, weights = (np.asarray(cv2.copyMakeBorder(a, *edges), np.float32) for a in (sums, weights))
    half = weights.shape[1] // 2, weights.shape[0] // 2
    up, upw = (4 * np.asarray(cv2.resize(a, half, interpolation=cv2.INTER_AREA), np.float32) for a in (sums, weights))
    return up, upw


@kernel
def relax(
    base: Float32Array, usable: BoolArray, cells: NDArray[np.int64], mean: Float32Array, screen: Real, sweeps: Whole
) -> None:
    """Over-relaxed Gauss-Seidel on (n + screen) u = sum of n usable neighbours + screen mean at `cells`, in place."""
    rows, cols = usable.shape
    for sweep in range(sweeps):
        for o in range(len(cells)):
            cell = cells[o] if sweep % 2 == 0 else cells[len(cells) - 1 - o]
            y, x = cell // cols, cell % cols
            for k in range(3):
                total, n = screen * mean[k], screen
                for d in range(4):
                    yy = y + (d == 0) - (d == 1)
                    xx = x + (d == 2) - (d == 3)
                    if 0 <= yy < rows and 0 <= xx < cols and usable[yy, xx]:
                        total += base[yy, xx, k]
                        n += 1
                base[y, x, k] += 1.6 * (total / n - base[y, x, k])
