"""Numba kernel of regions: depth and free pixels in; connected regions out. Loaded when masks are found."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Whole, kernel, piece
from dlama.geometry.rgbd import BoolArray, Float32Array


@piece
def root_of(parent: NDArray[np.int32], pixel: Whole) -> Whole:
    """The root of a pixel's region in the union-find forest; paths are halved on the way."""
    while parent[pixel] != pixel:
        parent[pixel] = parent[parent[pixel]]
        pixel = parent[pixel]
    return pixel


@kernel
def join_regions(
    depth: Float32Array,
    free: BoolArray,
    offsets: NDArray[np.int64],
    allowed: Float32Array,
    parent: NDArray[np.int32],
) -> None:
    """Union-find over free pixels: two pixels join where their depths differ by at most a share of the nearer one.

    depth: H x W metres. free: H x W bool. offsets: N x 2, rows and columns to the neighbours of a pixel, rows >= 0. allowed: N,
    the largest difference as a share of the nearer depth. parent: H * W int32, each pixel its own index at first; then the
    index of one pixel of the region.
    """
    rows, columns = depth.shape
    for row in range(rows):
        for column in range(columns):
            if not free[row, column]:
                continue
            here = depth[row, column]
            for number in range(len(offsets)):
                r, c = row + offsets[number, 0], column + offsets[number, 1]
                if r >= rows or c < 0 or c >= columns or not free[r, c]:
                    continue
                there = depth[r, c]
                if abs(here - there) <= allowed[number] * min(here, there):
                    one, other = root_of(parent, row * columns + column), root_of(parent, r * columns + c)
                    if one != other:
                        parent[max(one, other)] = np.int32(min(one, other))
    for pixel in range(len(parent)):
        parent[pixel] = np.int32(root_of(parent, pixel))
