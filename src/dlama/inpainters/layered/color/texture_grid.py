"""A picture with inverse depth and surface labels everywhere in; the pixels that may be copied, in full and shrunk to cells,
out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.layered.kernels.cells import shrink, trusted_sources

Labels = NDArray[np.int8]
UNTRUSTED = -2
"""Label of pixels that must not be copied: holes, and pixels next to a nearer surface, whose colour may be mixed."""
FEW, SHARE_LEFT = 100, 0.25
"""Least number and share of a surface's pixels that must remain trusted; below, pixels nearer to occluders are trusted, too:
leaves have no others."""
BAND = 256
"""Rows that are counted at a time."""
WORK_SIZE = 256
"""Longer side, in cells, of the grid on which texture is compared."""


@dataclass(frozen=True, eq=False)
class TextureGrid:
    """One picture, prepared for copying texture within its surfaces.

    Two grids lie over the picture: texture is compared in cells of `cell_size` pixels, base colours stand on a grid twice as
    coarse. Labels: -1 non-planar, 0 sky, k >= 1 the k-th plane, UNTRUSTED.
    """

    color: UInt8Array
    """H x W x 3, RGB."""
    hole: BoolArray
    """H x W, True = to be painted."""
    inverse_depth: Float32Array
    """H x W, 1/m, filled everywhere; 0 = sky."""
    label: Labels
    """H x W, filled everywhere."""
    camera: Camera
    trusted: Labels
    """H x W: the label of pixels that may be copied, else UNTRUSTED."""
    cell_size: int
    """Pixels along a side of a cell."""
    cell_color: Float32Array
    """rows x cols x 3: mean of the cell's trusted pixels."""
    cell_inverse_depth: Float32Array
    """rows x cols, 1/m: the same."""
    cell_label: Labels
    """rows x cols: the label of cells most of whose pixels are trusted and of one surface, else UNTRUSTED."""

    @classmethod
    def of(
        cls,
        color: UInt8Array,
        hole: BoolArray,
        inverse_depth: Float32Array,
        label: Labels,
        camera: Camera,
        spoiled: BoolArray | None = None,
    ) -> TextureGrid:
        """The grid of arrays of one size; what is `spoiled` (H x W) is copied only where all of its surface is."""
        color, hole = np.ascontiguousarray(color), np.ascontiguousarray(hole)
        inverse_depth = np.ascontiguousarray(inverse_depth, np.float32)
        label = np.ascontiguousarray(label, np.int8)
        cell_size = max(1, -(-max(hole.shape) // WORK_SIZE))
        trusted = trusted_labels(hole, inverse_depth, label)
        if spoiled is not None and spoiled.any():
            left = np.flatnonzero(count_labels(trusted, ~spoiled)) + UNTRUSTED
            trusted[spoiled & is_one_of(trusted, left)] = UNTRUSTED
        cells = shrink(color, inverse_depth, trusted, cell_size)
        return cls(color, hole, inverse_depth, label, camera, trusted, cell_size, *cells)

    def at_unit_depth(self, label: int) -> TextureGrid:
        """The grid itself; for far regions (label 0) one at 1 m, so that translations by pixels move them."""
        if label != 0:
            return self
        near = np.where(self.label == 0, np.float32(1), self.inverse_depth)
        near_cells = np.where(self.cell_label == 0, np.float32(1), self.cell_inverse_depth)
        return replace(self, inverse_depth=near, cell_inverse_depth=near_cells)

    @property
    def base_cell_size(self) -> int:
        """Pixels along a side of a cell of the coarser grid of base colours."""
        return 2 * self.cell_size

    def base_cells(self, region: HoleRegion) -> NDArray[np.int64]:
        """N: flat index of the cell of that grid in which each of the region's N pixels lies."""
        rows, cols = np.divmod(region.pixels, self.hole.shape[1])
        width = -(-self.hole.shape[1] // self.base_cell_size)
        return np.asarray((rows // self.base_cell_size) * width + cols // self.base_cell_size)


@dataclass(frozen=True)
class HoleRegion:
    """The pixels of the hole that lie on one surface, and the cells that may give them colour."""

    label: int
    """-1 non-planar, 0 sky, k >= 1 the k-th plane."""
    pixels: NDArray[np.int64]
    """Flat indices of the hole pixels."""
    sources: BoolArray
    """rows x cols cells, True where a cell is known and belongs to the surface."""


def order_from_rim(inside: BoolArray) -> NDArray[np.int64]:
    """Flat indices of the cells inside (rows x cols), in order of their distance from the outside."""
    cells = np.flatnonzero(inside)
    distance = cv2.distanceTransform(inside.view(np.uint8), cv2.DIST_L2, 3)
    return cells[np.argsort(distance.ravel()[cells], kind="stable")]


def trusted_labels(hole: BoolArray, inverse_depth: Float32Array, label: Labels) -> Labels:
    """H x W: the label of every pixel that may be copied, UNTRUSTED elsewhere.

    Trusted pixels are two pixels from holes and nearer surfaces; closer ones count where too few are left (FEW, SHARE_LEFT).
    """
    trusted = np.where(trusted_sources(hole, inverse_depth, label, 2), label, np.int8(UNTRUSTED))
    needed, known = count_labels(label, hole), count_labels(label, ~hole)
    for reach in (1, 0):
        enough = count_labels(trusted, ~hole) > np.maximum(FEW, SHARE_LEFT * known)
        missing = np.flatnonzero((needed > 0) & ~enough) + UNTRUSTED
        if len(missing):
            near = is_one_of(label, missing) & trusted_sources(hole, inverse_depth, label, reach)
            trusted[near] = label[near]
    return trusted


def count_labels(label: Labels, where: BoolArray) -> NDArray[np.int64]:
    """How many pixels of `where` (H x W) have each label (H x W), from UNTRUSTED on."""
    out = np.zeros(256, np.int64)
    for first in range(0, len(label), BAND):  # OpenCV gives float32, which counts to 16 million
        codes, counted = (one[first : first + BAND].view(np.uint8) for one in (label, where))
        out += cv2.calcHist([codes], [0], counted, [256], [0, 256]).ravel().astype(np.int64)
    return np.roll(out, -UNTRUSTED)


def is_one_of(label: Labels, numbers: NDArray[np.int64]) -> BoolArray:
    """H x W, True where the label (H x W) is one of the few `numbers`."""
    out = np.zeros(label.shape, np.bool_)
    for number in numbers.tolist():
        out |= label == number
    return out
