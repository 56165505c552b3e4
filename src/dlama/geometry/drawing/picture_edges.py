"""A view whose depth edges are misaligned with its picture in; its depth with edges aligned to the picture out.

A depth camera and a matcher place edges a few pixels off: pixels of a table get the depth of the cabinet behind it, and vice
versa. In the view itself this is invisible; from elsewhere both get a torn fringe. The misalignment is measured.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.codes import Origin
from dlama.geometry.holes import dilate_square, fill_with_nearest, nearest_along_colors, square
from dlama.geometry.kernels.along_colors import DepthCost
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.kernels.picture_edges import ROOM, Edges, find_mixed, fit_planes
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, is_valid
from dlama.geometry.view import View

JUMP = 0.06
"""Relative step of inverse depth between neighbours that is an edge."""
LOOKED_AT = 8
"""Search range, in px to either side of a depth edge, of the picture's edge."""
LINES = 3
"""Step in rows and columns between the scanned lines."""
LEAST_EDGES = 40
"""Least number of edges."""
CLEARLY = 2
"""Least misalignment in px, at its own size, of an enlarged depth map that is more than its coarseness."""
WIDER = 3
"""Pixels beyond that reach that move, too, if colours agree: a fifth of the edges are farther off."""


class MapAxis(NamedTuple):
    """The pixels of a depth map along one side of the picture that it was enlarged to."""

    sides: int
    """Pixels of the picture."""
    pixel: float
    """Pixels of the picture to one of the map; 1: the map was not enlarged."""

    @classmethod
    def of(cls, changes: BoolArray) -> MapAxis:
        """From positions where depth changes: in an enlarged map 40 or more, four in five of them a constant distance apart (to a
        pixel), of 1.25 px or more."""
        sides = len(changes) + 1
        between = np.diff(np.flatnonzero(changes))
        if len(between) < 40:
            return cls(sides, 1.0)
        usual = between <= np.median(between) + 1
        steps = np.rint(between / between[usual].mean())  # where depth does not change a border is missing
        pixel = float(between.sum() / max(steps.sum(), 1))
        return cls(sides, pixel if pixel >= 1.25 and usual.mean() > 0.8 else 1.0)

    @property
    def middles(self) -> NDArray[np.intp]:
        """The pixel of the picture in the middle of each of the map."""
        number = np.arange(round(self.sides / self.pixel))
        return ((number + 0.5) * (self.sides / len(number))).astype(np.intp)

    @property
    def owners(self) -> NDArray[np.intp]:
        """The pixel of the map that each of the picture lies in."""
        return (np.arange(self.sides) * round(self.sides / self.pixel) // self.sides).astype(np.intp)


class MapGrid(NamedTuple):
    """The pixels of a depth map that may have been enlarged to the size of its picture by the nearest pixel."""

    rows: MapAxis
    columns: MapAxis

    @classmethod
    def of(cls, depth: Float32Array) -> MapGrid:
        """The grid of depth (H x W), by its blocks of equal values."""
        found = cls(MapAxis.of((depth[1:] != depth[:-1]).any(1)), MapAxis.of((depth[:, 1:] != depth[:, :-1]).any(0)))
        if not found.enlarged:
            return found
        if is_in_block(depth).sum() > 0.3 * is_valid(depth).sum():  # single readings on a lattice have none
            return found
        return cls(found.rows._replace(pixel=1.0), found.columns._replace(pixel=1.0))

    @property
    def largest(self) -> float:
        """Pixels of the picture to one of the map, along the side where they are more."""
        return max(self.rows.pixel, self.columns.pixel)

    @property
    def enlarged(self) -> bool:
        """Whether the map was enlarged."""
        return self.largest > 1

    @property
    def wh(self) -> tuple[int, int]:
        """Pixels of the map, across and down."""
        return len(self.columns.middles), len(self.rows.middles)

    def sample_map(self, values: np.ndarray) -> np.ndarray:
        """Values of the picture (H x W) at the pixels of the map; unchanged where it was not enlarged."""
        return values[self.rows.middles][:, self.columns.middles] if self.enlarged else values

    def picture(self, color: UInt8Array) -> UInt8Array:
        """The picture (H x W x 3) at the size of the map."""
        if not self.enlarged:
            return color
        return np.asarray(cv2.resize(color, self.wh, interpolation=cv2.INTER_AREA), np.uint8)

    def enlarge(self, values: np.ndarray) -> np.ndarray:
        """Values of the map at the pixels of the picture."""
        return values[self.rows.owners][:, self.columns.owners]


def is_in_block(depth: Float32Array) -> BoolArray:
    """H x W, True where a pixel has a depth (H x W) and the next one, above, below, left or right, the same."""
    out, valid = np.zeros(depth.shape, np.bool_), is_valid(depth)
    for one, other in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        same = valid[one] & (depth[one] == depth[other])
        out[one] |= same
        out[other] |= same
    return out


class AlignedDepth(NamedTuple):
    """A view's depth with its edges aligned to the picture."""

    depth: Float32Array
    """H x W metres; pixels near misaligned edges have the depth of the surface of their colour."""
    mixed: BoolArray
    """H x W, True behind an edge where the colour is mixed with the occluder's."""
    misaligned: BoolArray
    """H x W, True within the reach of misaligned edges; all False where edges are aligned."""


def align_edges(view: View) -> AlignedDepth:
    """Depth with its edges aligned to the picture; the depth itself where they are, or where this cannot be measured."""
    reach = edge_uncertainty(view)
    if not reach:
        none = np.zeros(view.hole.shape, np.bool_)
        return AlignedDepth(view.depth, none, none)
    grid = MapGrid.of(view.depth)
    depth, known = grid.sample_map(view.depth), grid.sample_map(view.valid)
    ratio = edge_ratio(view.camera, grid.columns.pixel)
    placed = move_edges(grid.picture(view.color), depth, known, round(reach / grid.largest), ratio)
    if not grid.enlarged:
        return placed
    moved = grid.enlarge(placed.depth != depth) & view.valid
    depth = np.where(moved, grid.enlarge(placed.depth), view.depth)
    return AlignedDepth(depth, grid.enlarge(placed.mixed), grid.enlarge(placed.misaligned) & view.valid)


def behind_edges(view: View) -> BoolArray:
    """H x W, True at valid pixels within 2 px (of 1024 of the longer side) behind an edge of estimated depth: what stands before
    it is mixed into their colours, and sharpening and JPEG leave a halo there."""
    reach = max(1, round(2 * max(view.hole.shape) / 1024))
    w = inverse_depth(np.where(view.valid, view.depth, np.float32(0)))
    nearest = np.asarray(cv2.dilate(w, square(2 * reach + 1)), np.float32)
    return view.valid & (nearest - w > 2 * JUMP * nearest) & near_jumps(w, reach)


def move_edges(color: UInt8Array, depth: Float32Array, known: BoolArray, reach: int, ratio: float) -> AlignedDepth:
    """Depth (H x W metres, where `known`) with edges up to `reach` px off aligned to the picture."""
    w = inverse_depth(np.where(known, depth, np.float32(0)))
    whole = fill_with_nearest(w, known)
    band, wide = near_jumps(whole, reach), near_jumps(whole, min(reach + WIDER, LOOKED_AT))
    levels = color.astype(np.float32)
    out, room = np.empty_like(w), np.empty((len(w), ROOM), np.float32)
    target = find_other_surfaces(w, known, wide & known, levels, ratio)
    in_bands(fit_planes, len(w), Edges(w, wide, levels, ratio, 2 * (reach + WIDER)), target, room, out)
    rim, neither = near_jumps(fill_with_nearest(out, known), 1), np.empty_like(known)  # a px round an edge is mixed
    in_bands(find_mixed, len(w), Edges(out, rim, levels, ratio, 2 * reach), room, neither)
    depth = np.where(out != w, 1 / np.maximum(out, np.float32(1e-6)), depth)
    return AlignedDepth(depth.astype(np.float32), neither, band & known)


def find_other_surfaces(
    w: Float32Array, known: BoolArray, band: BoolArray, color: Float32Array, ratio: float
) -> Float32Array:
    """H x W inverse depth of the surface that pixels of the band belong to by colour, where it is not their own; else 0.

    w: H x W 1/m, of pixels that are `known`; band: H x W, pixels whose depth may be wrong; color: H x W x 3; ratio:
    `edge_ratio`.
    """
    soft = np.asarray(cv2.medianBlur(color, 3), np.float32)  # grain is no edge
    reliable = known & ~band
    against = DepthCost(w, ratio, added=2.0)
    source = nearest_along_colors(soft, reliable, band, longest=30.0, against=against)
    rows, columns = np.nonzero(band & (source >= 0))
    there, across = np.divmod(source[rows, columns], w.shape[1])
    own, other = w[rows, columns], w[there, across]
    away = np.maximum(np.abs(there - rows), np.abs(across - columns))
    changed = np.abs(own - other) > ratio * (2 + away) * np.maximum(own, other)
    out = np.zeros_like(w)
    out[rows[changed], columns[changed]] = other[changed]
    return out


def edge_ratio(camera: Camera, pixels: float = 1.0) -> float:
    """Relative step in inverse depth, over so many pixels, above which neighbours need a slope to be one surface.

    A surface seen at 80 degrees changes by 5.7 / f per pixel; the floor of 1 % is a depth sensor's noise.
    """
    return float(np.clip(6.0 * pixels / camera.fx, 0.01, 0.03))


def near_jumps(w: Float32Array, reach: int) -> BoolArray:
    """H x W, True within `reach` px of a jump of inverse depth (H x W, known everywhere) between neighbours."""
    high, low = cv2.dilate(w, square(3)), cv2.erode(w, square(3))
    return dilate_square(np.asarray(high - low > JUMP * high), 2 * reach + 1)


def edge_uncertainty(view: View) -> int:
    """Misalignment in px of measured depth edges with the picture's, their quantile of 0.8; 0 where half of them are aligned."""
    measured = view.valid & (view.origin == Origin.MEASURED.value)
    return edge_misalignment(view.color, view.depth, measured, view.far)


def edge_misalignment(color: UInt8Array, depth: Float32Array, measured: BoolArray, far: BoolArray) -> int:
    """As `edge_uncertainty`, of depth (H x W metres) where it is measured or far; 0 of fewer than LEAST_EDGES.

    An enlarged depth map is measured at its own size; there a misalignment below CLEARLY pixels comes from its coarseness: 0.
    """
    if measured.sum() < LEAST_EDGES:
        return 0
    grid = MapGrid.of(depth)
    color, (depth, measured, far) = grid.picture(color), map(grid.sample_map, (depth, measured, far))
    w = fill_with_nearest(inverse_depth(np.where(measured, depth, np.float32(0))), measured | far)
    offsets = np.concatenate([edge_offsets(w, color), edge_offsets(w.T, color.transpose(1, 0, 2))])
    if len(offsets) < LEAST_EDGES or np.median(offsets) == 0:
        return 0
    off = int(np.quantile(offsets, 0.8))
    return off if not grid.enlarged else round(off * grid.largest) * (off >= CLEARLY)


def edge_offsets(w: Float32Array, color: UInt8Array) -> NDArray[np.int64]:
    """N distances in px, along some rows, from isolated depth edges to the nearest edge of the picture: a step of over 20 levels
    (mean over channels) and twice the median one around."""
    w, color = w[LINES - 1 :: LINES], color[LINES - 1 :: LINES]
    before, after = w[:, :-1], w[:, 1:]
    jump = np.abs(after - before) > JUMP * np.maximum(before, after)
    rows, columns = np.nonzero(jump[:, LOOKED_AT:-LOOKED_AT])
    around = columns[:, None] + np.arange(2 * LOOKED_AT + 1)
    lone = jump[rows[:, None], around].sum(1) == 1
    rows, around = rows[lone, None], around[lone]
    step = np.abs(color[rows, around + 1].astype(np.float32) - color[rows, around]).mean(2)
    highest = step.max(1, initial=0)
    clear = (highest > 20) & (highest > 2 * np.median(step, 1)) if len(step) else np.zeros(0, np.bool_)
    distance = np.abs(np.arange(-LOOKED_AT, LOOKED_AT + 1))
    return np.where(step[clear] > highest[clear, None] / 2, distance, LOOKED_AT).min(1, initial=LOOKED_AT)
