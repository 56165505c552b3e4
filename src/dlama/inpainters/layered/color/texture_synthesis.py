"""Texture synthesis: a picture with inverse depth and surface labels everywhere (a grid) in; the hole's colours, from the
background, out.

Every hole pixel is a smooth *base*, interpolated along its own surface. On planes *detail* is added, copied from the same plane
by a 3D translation within it, so that bricks and planks follow perspective. The weight of the detail is the autocorrelation of
the known texture under that translation, its least-squares gain (see `offset_search`).
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.layered.color.offset_search import Bases, CopiedDetail, copy_detail
from dlama.inpainters.layered.color.texture_grid import UNTRUSTED, HoleRegion, TextureGrid, order_from_rim
from dlama.inpainters.layered.kernels import base_color as base_kernels
from dlama.inpainters.layered.kernels.patch_offsets import Paint, Sources, paint_pixels

GREY = 128
"""Colour in a view without any known pixel."""
SKY_COLOR = (120, 145, 175)
"""Colour of a sky that no picture shows: a pale daylight blue."""
LEAST_CELLS = 12
"""Planes with fewer known cells are painted as no plane."""
BAND = 2048
"""Pixels per task."""
SCREEN = 0.002
"""Weight of a surface's mean colour in each cell of its base, next to the 4 of the neighbours (screened Laplace equation)."""
DEPTH_SCREEN = 0.002
"""The same for no plane, towards the mean of all cells at that depth and behind: a small rim must not colour everything."""


def synthesize(grid: TextureGrid, *, seed: int = 0, sky: Float32Array | None = None, detail: bool = True) -> UInt8Array:
    """H x W x 3: colour for the hole of a grid, from known pixels of the same surface; known pixels come back bit-identical.

    sky: RGB of a sky that this view does not show; None: SKY_COLOR. detail: False leaves the smooth base colours
    alone. The same seed gives the same bits.
    """
    out, hole = np.array(grid.color), grid.hole
    if not hole.any():
        return out
    out[hole] = GREY
    out[hole & (grid.label == 0) & ~hole.all()] = SKY_COLOR if sky is None else np.rint(sky)
    regions = sorted(hole_regions(grid), key=lambda region: -len(region.pixels))

    def paint_regions(first: int, last: int) -> None:
        for region in regions[first:last]:
            paint_region(out, grid, region, np.random.default_rng([seed, 1 + region.label]) if detail else None)

    in_bands(paint_regions, len(regions), band=1)
    return out


def paint_region(out: UInt8Array, grid: TextureGrid, region: HoleRegion, rng: np.random.Generator | None) -> None:
    """Paint one region into `out` (H x W x 3). rng: None leaves the base colours alone."""
    if not region.sources.any():
        return
    bases = surface_bases(grid, region) if region.label >= 0 else (depth_base(grid, region),) * 2
    unit = grid.at_unit_depth(region.label)
    copied = CopiedDetail.none(bases[0].shape[:2]) if rng is None else copy_detail(unit, region, bases, rng)
    sources = Sources(1, unit.inverse_depth, grid.trusted, region.label, copied.axes)
    paint = Paint(as_input(grid.color), *bases, grid.base_cell_size, copied.choice, copied.gains, copied.offsets)
    pixels, room = region.pixels, np.zeros((len(region.pixels), 3))
    in_bands(paint_pixels, len(pixels), pixels, sources, paint, room, out, band=BAND)


def hole_regions(grid: TextureGrid) -> Iterator[HoleRegion]:
    """The hole split into regions: sufficiently visible planes and sky, and the rest as one (label -1)."""
    holes = np.flatnonzero(grid.hole)
    labels = grid.label.ravel()[holes]
    rest = np.ones(len(holes), np.bool_)
    for label in np.unique(labels[labels >= 0]).tolist():
        sources, here = grid.cell_label == label, labels == label
        if sources.sum() >= LEAST_CELLS or label == 0:
            rest &= ~here
            yield HoleRegion(label, holes[here], sources)
    if rest.any():
        yield HoleRegion(-1, holes[rest], grid.cell_label != UNTRUSTED)


def depth_base(grid: TextureGrid, region: HoleRegion) -> Float32Array:
    """rows x cols x 3 colours that spread from the rim between neighbours of similar depth, never from nearer ones.

    Labels do not count: depth without a plane was interpolated from all its surroundings, and so is its colour.
    """
    colors, far = base_kernels.farthest(grid.cell_color, grid.cell_inverse_depth, grid.cell_label)
    known = base_kernels.even_out(colors, far, 2)
    base = known.copy()
    depth = np.full(far.size, np.inf, np.float32)
    np.minimum.at(depth, grid.base_cells(region), grid.inverse_depth.ravel()[region.pixels])
    inside = np.isfinite(depth).reshape(far.shape)
    depth = np.where(inside, depth.reshape(far.shape), far)
    cells = order_from_rim(inside)
    mean, any_behind = _mean_behind(known, depth.ravel()[cells], far)
    base.reshape(-1, 3)[cells] = np.where(any_behind[:, None], mean, GREY)
    base_kernels.spread(base, depth, (far >= 0) & ~inside, cells, mean, DEPTH_SCREEN * any_behind, 80)
    return base_kernels.skirt(base, depth, inside)


def _mean_behind(base: Float32Array, depth: Float32Array, far: Float32Array) -> tuple[NDArray[np.float64], BoolArray]:
    """For each of N inverse depths: mean colour (N x 3) of all known cells there and behind, and whether there are any."""
    known = far >= 0
    order = np.argsort(far[known], kind="stable")
    count = np.searchsorted(far[known][order], 1.1 * depth + 1e-6, side="right")
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(base[known][order], axis=0, dtype=np.float64)])
    return sums[count] / np.maximum(count, 1)[:, None], count > 0


def surface_bases(grid: TextureGrid, region: HoleRegion) -> Bases:
    """A slightly and a strongly blurred picture of one surface's known cells, extrapolated into the hole.

    First by a pyramid, then as a screened membrane (Laplace's equation).
    """
    weight = region.sources.astype(np.float32)
    sums, weights = base_kernels.pull(grid.cell_color * weight[..., None], weight)
    cells = np.unique(grid.base_cells(region))
    known = weights > 0
    usable = known.copy()
    usable.ravel()[cells] = True
    cells = cells[~known.ravel()[cells]]
    fields = []
    for sigma in (2.0, 7.0):
        blurred, share = (cv2.GaussianBlur(a, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT) for a in (sums, weights))
        fields.append(_extrapolate(np.asarray(blurred, np.float32), np.asarray(share, np.float32), usable, cells))
    return fields[0], fields[1]


def _extrapolate(
    sums: Float32Array, weights: Float32Array, usable: BoolArray, cells: NDArray[np.int64]
) -> Float32Array:
    """Weighted sums to values everywhere: pull to one cell, push back, then relax the unknown cells."""
    weights[weights < 1e-3] = 0
    sums[weights == 0] = 0
    ladder = [(sums, weights)]
    while max(ladder[-1][1].shape) > 1:
        ladder.append(base_kernels.pull(*ladder[-1]))
    top, top_weight = ladder.pop()
    value = (top / np.maximum(top_weight, np.float32(1e-9))[..., None]).astype(np.float32)
    mean = value[0, 0].astype(np.float64)
    for level in reversed(ladder):
        value = base_kernels.push(*level, value)
    base_kernels.relax(value, usable, cells, mean, SCREEN, 40)
    return value
