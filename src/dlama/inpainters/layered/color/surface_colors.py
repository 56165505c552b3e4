"""A view and its continued surfaces in; smooth colours of its holes, spread along the surface that each pixel lies on, out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.enlarging import enlarge_at
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.layered.depth.surfaces import Surfaces
from dlama.inpainters.layered.kernels.cells import UNTRUSTED, Cells, Labels, pull, relax, shrink, trusted_sources
from dlama.inpainters.layered.remaining_shadows import find_remaining_shadow
from dlama.inpainters.opencv import pull_push
from dlama.perception.planes import SKY

GREY = 128
"""Colour in a view without any known pixel."""
SKY_COLOR = (120, 145, 175)
"""Colour of a sky that no picture shows: a pale daylight blue."""
LEAST_CELLS = 12
"""Planes with fewer known cells are painted as no plane."""
BLUR_CELLS = 2.0
"""Sigma of the blur of known colours, in cells of the base."""
SCREEN = 0.002
"""Weight of a surface's mean colour in each cell of its base, next to the 4 of the neighbours (screened Laplace equation)."""
NEARER = 1.1
"""Ratio of inverse depths from which what is known is nearer than what is filled, and gives it no colour: in narrow holes, and
where there is no plane."""
TRUSTED_PX = 2
"""Least distance from holes and nearer surfaces of pixels that show their surface's own colour."""
LONGER_SIDE = 256
"""Of the grid, in cells."""


def paint_surfaces(view: View, surfaces: Surfaces, context: FillContext) -> UInt8Array:
    """H x W x 3: the view's colours, with those of each surface spread into its colour holes; surfaces: of
    `continue_lawfully`."""
    if not view.color_hole.any():
        return view.color
    w, label = surfaces.inverse_depth, surfaces.label.copy()
    label[view.hole & (w == 0)] = SKY
    leafy = paint_leaves(view.color, view, find_leaves(view, surfaces))
    shadow = np.zeros_like(view.hole)
    if view.object_hole.any():
        shadow = find_remaining_shadow(view, label, context.law)
    return spread_colors(leafy, surfaces.without_leaves(view.color_hole), w, label, spoiled=shadow, sky=context.sky)


def find_leaves(view: View, surfaces: Surfaces) -> NDArray[np.intp]:
    """2 x N flat indices: hole pixels whose colour is unknown into which foliage extends, and the known leaf that each copies."""
    return surfaces.leaves[:, view.color_hole.ravel()[surfaces.leaves[0]]]


def paint_leaves(color: UInt8Array, view: View, leaves: NDArray[np.intp]) -> UInt8Array:
    """H x W x 3 colours with copied leaves (2 x N, of `find_leaves`) where foliage extends into the view's colour holes."""
    if not leaves.size:
        return color
    out = color.copy()
    out.reshape(-1, 3)[leaves[0]] = view.color.reshape(-1, 3)[leaves[1]]
    return out


class HoleRegion(NamedTuple):
    """The pixels of the hole that lie on one surface, and the cells that give them colour."""

    pixels: NDArray[np.int64]
    """Flat indices of the hole pixels."""
    cells: NDArray[np.int64]
    """Flat index of the cell of the base in which each of them lies."""
    sources: BoolArray
    """rows x cols cells of the grid, True where a cell is known and belongs to the surface."""


def spread_colors(
    color: UInt8Array,
    hole: BoolArray,
    inverse_depth: Float32Array,
    label: Labels,
    *,
    spoiled: BoolArray | None = None,
    sky: Float32Array | None = None,
) -> UInt8Array:
    """H x W x 3: smooth colours for the hole, from known pixels of the same surface; known pixels come back bit-identical.

    color: H x W x 3; hole: H x W; inverse_depth: H x W, 1/m, filled everywhere, 0 = sky; label: H x W, filled everywhere: -1
    non-planar, 0 sky, k >= 1 the k-th plane; spoiled: H x W, pixels whose colour is used only where all of their surface is;
    sky: RGB of a sky that this view does not show; None: SKY_COLOR. Bases stand on a grid twice as coarse as that of the cells.
    """
    out = np.array(color)
    if not hole.any():
        return out
    out[hole] = GREY
    out[hole & (label == SKY) & ~hole.all()] = SKY_COLOR if sky is None else np.rint(sky)
    grid, size = divide_into_cells(
        color, hole, inverse_depth, label, np.zeros_like(hole) if spoiled is None else spoiled
    )
    regions = sorted(hole_regions(grid, 2 * size, hole, inverse_depth, label), key=lambda region: -len(region.pixels))

    def paint_regions(first: int, last: int) -> None:
        for region in regions[first:last]:
            if region.sources.any():
                base = surface_base(grid, region)
                found = enlarge_at(base, region.pixels, hole.shape[1], (2 * size, 2 * size))
                out.reshape(-1, 3)[region.pixels] = np.rint(found, out=found)

    in_bands(paint_regions, len(regions), band=1)
    return out


def hole_regions(
    grid: Cells, size: int, hole: BoolArray, inverse_depth: Float32Array, label: Labels
) -> Iterator[HoleRegion]:
    """The hole split into regions: sufficiently visible planes and sky, and the rest by its depth, in octaves, which takes colour
    from all surfaces that are no nearer, of the sky only where there are none. size: pixels along a side of the base's cells."""
    holes = np.flatnonzero(hole)
    rows, cols = np.divmod(holes, hole.shape[1])
    cells = (rows // size) * -(-hole.shape[1] // size) + cols // size
    labels, w = label.ravel()[holes], inverse_depth.ravel()[holes]
    rest = np.ones(len(holes), np.bool_)
    for number in np.unique(labels[labels >= 0]).tolist():
        sources, here = grid.label == number, labels == number
        if sources.sum() >= LEAST_CELLS or number == SKY:
            rest &= ~here
            yield HoleRegion(holes[here], cells[here], sources)
    octave = np.floor(np.log2(np.maximum(w, np.float32(1e-6))))
    for number in np.unique(octave[rest]).tolist():
        here = rest & (octave == number)
        behind = (grid.label != UNTRUSTED) & (grid.inverse_depth <= NEARER * w[here].max())
        finite = behind & (grid.label != SKY)
        behind = finite if finite.any() else behind
        yield HoleRegion(holes[here], cells[here], behind)


def surface_base(grid: Cells, region: HoleRegion) -> Float32Array:
    """rows x cols x 3: one surface's known cells, slightly blurred, extrapolated into the hole.

    First by a pyramid, then as a screened membrane (Laplace's equation).
    """
    weight = region.sources.astype(np.float32)
    sums, weights = pull(grid.color * weight[..., None], weight)
    cells = np.unique(region.cells)
    known = weights > 0
    usable = known.copy()
    usable.ravel()[cells] = True
    sums, weights = (
        np.asarray(cv2.GaussianBlur(a, (0, 0), BLUR_CELLS, borderType=cv2.BORDER_CONSTANT), np.float32)
        for a in (sums, weights)
    )
    value = pull_push(sums / np.maximum(weights, np.float32(1e-9))[..., None], weights > 1e-3)
    mean = grid.color[region.sources].mean(0, np.float64)
    relax(value, usable, cells[~known.ravel()[cells]], mean, SCREEN, 40)
    return value


def divide_into_cells(
    color: UInt8Array, hole: BoolArray, inverse_depth: Float32Array, label: Labels, spoiled: BoolArray
) -> tuple[Cells, int]:
    """The cells of arrays of one size (H x W), and the pixels along a side of each; what is `spoiled` counts only where all of
    its surface is."""
    size = max(1, -(-max(hole.shape) // LONGER_SIDE))
    trusted = np.where(trusted_sources(hole, inverse_depth, label, TRUSTED_PX), label, np.int8(UNTRUSTED))
    for number in np.unique(trusted[spoiled]).tolist():
        own = trusted == number
        if (own & ~spoiled).any():
            trusted[own & spoiled] = UNTRUSTED
    return shrink(color, inverse_depth, trusted, size), size
