"""Patch offsets: one region of the hole in; the 3D translations that copy its texture, with their weights, out.

After He & Sun, "Statistics of patch offsets for image completion" (2012), with offsets that are translations in the region's
plane, so that texture follows perspective. They are scored by the autocorrelation of the known texture.
"""

from __future__ import annotations

import numpy as np

from dlama.inpainters.layered.color.offset_search import Array, Bases, CopiedDetail, OffsetSearch
from dlama.inpainters.layered.color.texture_grid import HoleRegion, TextureGrid

SMALLEST = 0.003
"""Share of the picture from which detail is copied into a region: in smaller ones it changes LPIPS of views by 0.0 %."""
FAR_CONTRAST = 3.0
"""Median fine detail, in grey levels, from which a far region is no sky."""


def copy_detail(grid: TextureGrid, region: HoleRegion, bases: Bases, rng: np.random.Generator) -> CopiedDetail:
    """Offsets and weights for one region; none (base colour alone) where nothing can be copied."""
    nothing = CopiedDetail.none(bases[0].shape[:2])
    # Where there is no plane, neither scale nor slant is known: measured, no gain.
    if region.label < 0 or region.sources.sum() < 24 or len(region.pixels) < SMALLEST * grid.hole.size:
        return nothing
    axes = np.eye(2, 3) if region.label == 0 else _plane_axes(grid, region, rng)
    search = OffsetSearch(grid, region, bases, axes, rng)
    # Copied sky ends in hard edges: measured. What is far and no sky (depth that ends at 10 m) has texture.
    if region.label == 0 and search.contrast() < FAR_CONTRAST:
        return nothing
    offsets = search.choose_offsets(rng)
    return search.assign_offsets(offsets) if len(offsets) else nothing


def _plane_axes(grid: TextureGrid, region: HoleRegion, rng: np.random.Generator) -> Array:
    """K e for two directions e of the plane, per metre; the plane is fitted to known and hole pixels of the region's surface."""
    factor, width = grid.cell_size, grid.hole.shape[1]
    y, x = np.nonzero(grid.cell_label == region.label)
    y, x = (
        np.minimum(y * factor + factor // 2, grid.hole.shape[0] - 1),
        np.minimum(x * factor + factor // 2, width - 1),
    )
    flat = np.concatenate([(y * width + x)[grid.trusted[y, x] == region.label], region.pixels])
    flat = flat[rng.integers(0, len(flat), min(len(flat), 4000))]
    points = np.stack([flat % width + 0.5, flat // width + 0.5, np.ones(len(flat))], 1)
    plane = np.linalg.lstsq(points / grid.inverse_depth.ravel()[flat][:, None], np.ones(len(flat)), rcond=None)[0]
    normal = grid.camera.K.T @ plane
    normal /= np.linalg.norm(normal)
    first = np.cross(normal, [0, 1, 0] if abs(normal[1]) < 0.9 else [0, 0, 1])
    first /= np.linalg.norm(first)
    return np.stack([grid.camera.K @ first, grid.camera.K @ np.cross(normal, first)])
