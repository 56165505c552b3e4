"""Foliage: known leaves and the circles of cut crowns in; the known pixel that each crown pixel is copied from out.

Blocks of the known crown, leaves and gaps, are quilted where it extends. So leaves stay as large and bright, and the crown as
dense, as in its visible part.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import HoleType
from dlama.geometry.holes import erode_mask, morphological_close, morphological_open, nearest_known, square
from dlama.geometry.kernels.jit import as_input
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.layered.depth.cut_objects import GAPS, CutObjects, at_same_depth
from dlama.inpainters.layered.kernels.quilt import GAP, OUTSIDE, UNDECIDED, quilt

SMALLEST = 6
"""Pixels a side of the smallest block: a narrower strip shows no leaves."""


@dataclass(frozen=True, eq=False)
class Crown:
    """A cut crown and its surroundings, h x w pixels of a view."""

    color: UInt8Array
    """h x w x 3."""
    leaf: BoolArray
    """h x w: known leaves."""
    behind: BoolArray
    """h x w: known background."""
    unseen: BoolArray
    """h x w: holes out of view."""
    hidden: BoolArray
    """h x w: dis-occluded holes."""
    unseen_crown: BoolArray
    """h x w: the part of `unseen` that the crown extends into."""
    circle: NDArray[np.float64]
    """Row, column and radius, in pixels."""
    cell: float
    """Pixels a side of the cells on which it was found."""

    def copy_from(self, rng: np.random.Generator) -> NDArray[np.int32]:
        """h x w: flat index of the known pixel that a hole pixel is copied from, negative for none."""
        within = morphological_close(self.leaf, self.square(GAPS))
        nearest = np.where(self.behind, GAP, nearest_known(self.pure_leaves())[1])
        known = np.where(within, nearest, np.where(self.behind, GAP, OUTSIDE))
        out = np.where(self.hidden & morphological_close(self.leaf, self.square(GAPS / 2)), known, OUTSIDE)
        own = self.unseen & morphological_close(self.unseen_crown | within, self.square(2))
        state = np.where(own, UNDECIDED, known).astype(np.int32)
        if own.any() and self.quilt(state, (within | self.behind) & ~own, rng):
            inside = self.depth_inside(own | within) > self.rim(state, own)
            out = np.where(own & inside, state, out)
        return out.astype(np.int32)

    def square(self, cells: float) -> np.ndarray:
        """A square of about that many cells a side, in pixels, an odd number."""
        return square(round(cells * self.cell) | 1)

    def pure_leaves(self) -> BoolArray:
        """h x w: known leaves surrounded by leaves, since others are mixed with the background; all leaves if those are too
        few."""
        inner = erode_mask(self.leaf, 1)
        return inner if inner.sum() > max(100, 0.1 * self.leaf.sum()) else self.leaf

    def quilt(self, state: NDArray[np.int32], known: BoolArray, rng: np.random.Generator) -> bool:
        """Decide `state` (h x w, see `kernels.quilt`) in place from blocks of `known` pixels (h x w); False: too few."""
        side, corners = self.known_blocks(known)
        if not len(corners):
            return False
        pitch = max(1, int(0.6 * side))  # blocks overlap
        places = np.unique(np.argwhere(state == UNDECIDED) // pitch, axis=0) * pitch - (side - pitch) // 2
        middle = np.clip(places + side // 2, 0, np.array(state.shape) - 1)
        order = np.argsort(nearest_known(self.leaf)[0][tuple(middle.T)], kind="stable")
        first, known_first = (each.astype(np.int32, order="C") for each in (places[order], corners))
        tried = rng.integers(0, len(corners), (len(first), 24)).astype(np.int32)
        bumps = leafy(state.shape, max(1.0, side / 8))
        marks = self.marks(first, side), tried, self.marks(corners, side)
        quilt(state, as_input(self.color), first, known_first, *marks, side, max(1, side // 8), 80.0, bumps)
        return True

    def known_blocks(self, known: BoolArray) -> tuple[int, NDArray[np.int64]]:
        """Pixels a side, and N x 2 corners (row, column), of blocks of `known` pixels (h x w) with leaves; N = 0: too few."""
        side = max(SMALLEST, round(8 * self.cell))
        while side >= SMALLEST:
            filled = (cv2.boxFilter(a.astype(np.float32), -1, (side, side), anchor=(0, 0)) for a in (known, self.leaf))
            whole, leaves = (a[: 1 - side, : 1 - side] for a in filled)
            step = max(1, side // 6)
            corners = np.argwhere(((whole > 1 - 0.5 / side**2) & (leaves > 0.02))[::step, ::step]) * step
            if len(corners) >= 8:
                return side, corners
            side = side * 2 // 3
        return side, np.zeros((0, 2), np.int64)

    def marks(self, corners: NDArray[np.integer], side: int) -> Float32Array:
        """N x 2 weighted radius and height, by which blocks are compared: crowns are sparse at the rim; corners: N x 2."""
        away = (corners + side / 2 - self.circle[:2]) / self.circle[2]
        return np.stack([2.0 * np.hypot(*away.T), 0.7 * away[:, 0]], 1).astype(np.float32)

    def depth_inside(self, body: BoolArray) -> Float32Array:
        """h x w distance in pixels to the outside of `body` (h x w), which extends beyond the picture."""
        grown = cv2.copyMakeBorder(body.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
        return np.asarray(cv2.distanceTransform(grown, cv2.DIST_L2, 5)[1:-1, 1:-1], np.float32)

    def rim(self, state: NDArray[np.int32], own: BoolArray) -> Float32Array:
        """h x w width in pixels of the rim to remove, narrower where leaves are bright: those are in front of dark ones.

        state: h x w, decided; own: h x w, where the crown extends.
        """
        light = self.color.reshape(-1, 3)[np.maximum(state, 0)].mean(-1)
        brighter = (light - light[own].mean()) / (light[own].std() + 1)
        rim = 1 + 0.7 * (leafy(own.shape, self.cell) - brighter)
        return np.asarray(0.06 * self.circle[2] * rim, np.float32)


def copy_leaves(view: View, w: Float32Array, cut: CutObjects, seed: int = 0) -> NDArray[np.intp]:
    """2 x N flat indices: hole pixels into which foliage extends, in order, and the known leaf that each is copied from.

    w: H x W inverse depth of the known pixels; cut: on a grid of cells.
    """
    out = np.full(w.shape, OUTSIDE, np.int32)
    cell = max(w.shape) / max(cut.number.shape)
    rng = np.random.default_rng(seed)
    for number, circle in enumerate((cut.circle * cell).astype(np.float64)):
        first, last = (np.clip(circle[:2] + by * circle[2], 0, w.shape).astype(np.int64) for by in (-1.4, 1.4))
        if number == 0 or (last - first).min() < SMALLEST:
            continue
        box = slice(first[0], last[0]), slice(first[1], last[1])
        leaves = crown(view, w, cut, number, box).copy_from(rng)
        rows, columns = np.divmod(leaves, leaves.shape[1])
        flat = (rows + first[0]) * w.shape[1] + columns + first[1]
        np.copyto(out[box], flat.astype(np.int32), where=leaves >= 0)
    pixels = np.flatnonzero(out >= 0)
    return np.stack([pixels, out.ravel()[pixels]])


def crown(view: View, w: Float32Array, cut: CutObjects, number: int, box: tuple[slice, slice]) -> Crown:
    """Crown `number` within a box of the view; other arguments as of `copy_leaves`."""
    cell = max(w.shape) / max(cut.number.shape)
    depth = cut.inverse_depth[number]
    own = (cv2.resize(cut.number, view.camera.wh, interpolation=cv2.INTER_NEAREST) == number)[box]
    hole, kind, w = view.hole[box], view.hole_type[box], w[box]
    known = ~hole & at_same_depth(w, depth)
    leaf = morphological_close(own, square(round(GAPS * cell) | 1)) & known & ~solid(w, known, round(6 * cell) | 1)
    unseen, hidden = (hole & (kind == each) for each in (HoleType.OUT_OF_VIEW, HoleType.DISOCCLUDED))
    circle = cut.circle[number] * cell - (box[0].start, box[1].start, 0)
    behind = ~hole & ~leaf & (w < depth)
    return Crown(np.ascontiguousarray(view.color[box]), leaf, behind, unseen, hidden, own & unseen, circle, cell)


def solid(w: Float32Array, known: BoolArray, side: int) -> BoolArray:
    """h x w, True in squares of `side` pixels without steps of depth. w: h x w inverse depth of the `known` pixels (h x w)."""
    least, most = cv2.erode(np.where(known, w, 0), square(3)), cv2.dilate(w, square(3))
    return morphological_open(known & (most < 1.01**2 * least), square(side))


def leafy(hw: tuple[int, ...], size: float) -> Float32Array:
    """h x w bumps `size` pixels wide (sigma), mean 0, standard deviation 1, the same at every call."""
    bumps = cv2.GaussianBlur(np.random.default_rng(0).normal(size=hw).astype(np.float32), (0, 0), size)
    return np.asarray(bumps / max(float(bumps.std()), 1e-6), np.float32)
