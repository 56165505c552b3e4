"""Patch offsets: one region of the hole in; the 3D translations that copy its surface's texture, with their weights, out.

After He & Sun, "Statistics of patch offsets for image completion" (2012), with offsets that are translations in the region's
plane, so that texture follows perspective. They are scored by the autocorrelation of the known texture.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import box_mean
from dlama.geometry.rgbd import Float32Array
from dlama.inpainters.layered.color.texture_grid import HoleRegion, TextureGrid, order_from_rim
from dlama.inpainters.layered.kernels import patch_offsets as kernels

Array = NDArray[np.float64]
Bases = tuple[Float32Array, Float32Array]
"""Two smooth colour fields on the base grid (rows x cols x 3): one true to the rim, one much smoother."""

SAMPLES = 320
"""Number of known points at which an offset is scored."""
COARSE = 2
"""Of the known points every second one is enough to find where the texture may repeat; all refine and choose in the end."""
NEAR, FAR = (20, 1, 3, 12), (36, 5, 2, 60)
"""Two searches: ticks to either side, work cells between them, ticks within which the best counts, and how many are kept."""
MOST_OFFSETS = 28
"""Most offsets of a region."""
GRAIN = 9.0
"""Grey levels (standard deviation) of uncorrelated fine detail that are kept: as smooth as looks natural, and no smoother."""
OUTLIER = 4.0
"""Standard deviations (robust) at which detail is clipped before it is compared."""
MEASURED = 2000
"""Known cells, at least, that a median is taken of: every so-many-th."""
SEAM_COST = 0.01
"""Cost of a seam per grey level of difference."""
SMALLEST = 0.003
"""Share of the picture from which detail is copied into a region: in smaller ones it changes LPIPS of views by 0.0 %."""
FAR_CONTRAST = 3.0
"""Median fine detail, in grey levels, from which a far region is no sky."""


@dataclass(frozen=True)
class CopiedDetail:
    """The sources of each cell of a region."""

    axes: Array
    """2 x 3: homogeneous pixel displacement per unit of offset along two directions of the plane."""
    offsets: Array
    """N x 2."""
    choice: NDArray[np.int32]
    """Base grid: index of the offset, -1 = none."""
    gains: Float32Array
    """Base grid x 3: weight 0..1 of the fine band, of the middle band and of the copied colour as it stands."""

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> CopiedDetail:
        """No detail on a base grid of that shape: the base colour alone."""
        nowhere, weightless = np.full(shape, -1, np.int32), np.zeros((*shape, 3), np.float32)
        return cls(np.zeros((2, 3)), np.zeros((1, 2)), nowhere, weightless)


class OffsetSearch:
    """The known texture of one region's surface, prepared for autocorrelation."""

    def __init__(
        self, grid: TextureGrid, region: HoleRegion, bases: Bases, axes: Array, rng: np.random.Generator
    ) -> None:
        self.grid, self.region, self.axes = grid, region, axes
        self.base_shape = bases[0].shape[:2]
        own, color = region.sources, grid.cell_color
        self.sources = kernels.Sources(grid.cell_size, grid.cell_inverse_depth, grid.cell_label, region.label, axes)
        self.some = np.flatnonzero(own)[:: max(1, int(own.sum()) // MEASURED)]
        self.bands = [self._detail_above(bases[1]), self._detail_above(bases[0])]
        self.bands.append(self.bands[0] - self.bands[1])
        self.bands.append(((color - color[own].mean(0)) * own[..., None]).astype(np.float32))
        self.compared = [np.clip(band, -limit, limit) for band in self.bands for limit in [self._outlier(band)]]
        self.known = self._known_cells()
        self.cells, self.centres = self._hole_cells()
        self.points = self._sample_points(rng)
        self.step = self._unit_step()

    def _outlier(self, band: Float32Array) -> np.float32:
        """Grey levels at which detail is clipped: a few bright spots would dominate the correlation."""
        return np.float32(OUTLIER * 1.4826 * np.median(np.abs(band.reshape(-1, 3)[self.some])) + 1)

    def contrast(self) -> float:
        """Median over the known cells of the size of fine detail, in grey levels."""
        return float(np.median(np.sqrt(channel_squares(self.bands[1]).ravel()[self.some] / 3)))

    def _detail_above(self, base: Float32Array) -> Float32Array:
        """Known colour minus a base, rows x cols x 3 cells; 0 where unknown."""
        own = self.region.sources
        rows, cols = own.shape
        fine = cv2.resize(base, (2 * base.shape[1], 2 * base.shape[0]), interpolation=cv2.INTER_LINEAR)[:rows, :cols]
        return np.ascontiguousarray((self.grid.cell_color - fine.reshape(rows, cols, 3)) * own[..., None], np.float32)

    def _known_cells(self) -> Array:
        """N x 3: u, v, inverse depth of the known cells' centres."""
        y, x = np.nonzero(self.region.sources)
        factor = self.grid.cell_size
        return np.stack([(x + 0.5) * factor, (y + 0.5) * factor, self.grid.cell_inverse_depth[y, x]], 1).astype(
            np.float64
        )

    def _hole_cells(self) -> tuple[NDArray[np.int64], Array]:
        """Flat indices of the hole's cells, and N x 3: u, v, inverse depth of their hole pixels' centre of mass."""
        y, x = np.divmod(self.region.pixels, self.grid.hole.shape[1])
        flat = self.grid.base_cells(self.region)
        count = np.bincount(flat)
        cells = np.flatnonzero(count)
        w = self.grid.inverse_depth.ravel()[self.region.pixels]
        sums = [np.bincount(flat, value)[cells] for value in (x + 0.5, y + 0.5, w)]
        return cells, np.stack(sums, 1) / count[cells][:, None]

    def _sample_points(self, rng: np.random.Generator) -> Array:
        """Known points: half of them from the quarter nearest to the hole, half from anywhere."""
        away = np.ones(self.base_shape, np.uint8)
        away.ravel()[self.cells] = 0
        distance = cv2.distanceTransform(away, cv2.DIST_L2, 3)
        cell = self.grid.base_cell_size
        there = distance[(self.known[:, 1] // cell).astype(int), (self.known[:, 0] // cell).astype(int)]
        near = np.argsort(there, kind="stable")[: max(24, len(there) // 4)]
        half = min(len(there), SAMPLES) // 2
        pick = np.concatenate([near[rng.integers(0, len(near), half)], rng.integers(0, len(there), half)])
        return self.known[pick]

    def _unit_step(self) -> Array:
        """Offset along each axis that moves a typical known place by one work cell."""
        u, v, w = self.points.T
        moves = [np.quantile(w * np.hypot(a[0] - u * a[2], a[1] - v * a[2]), 0.6) for a in self.axes]
        return self.grid.cell_size / np.maximum(moves, 1e-9)

    def score(self, offsets: Array, band: int = 0, every: int = 1) -> Float32Array:
        """Correlation of the known texture with itself under each offset, at every so-many-th of the known points.

        band: 0 all detail, 1 fine, 2 middle, 3 colour.
        """
        points = np.ascontiguousarray(self.points[::every])
        least = max(12, len(points) // 12)
        offsets = np.ascontiguousarray(offsets, np.float64)
        return kernels.correlate(offsets, points, self.compared[band], self.sources, least)

    def choose_offsets(self, rng: np.random.Generator) -> Array:
        """The few offsets that together bring every hole cell a good source (greedy cover)."""
        offsets = np.ascontiguousarray(np.concatenate([self._find_repeating(), self._sample_to_known(rng)]))
        some = np.ascontiguousarray(self.centres[rng.permutation(len(self.centres))[:600]])
        scale = kernels.change_of_scale(offsets, some, self.sources)
        worth = np.maximum(0.3 + self.score(offsets)[:, None] - 0.25 * scale, 0.01) * (scale >= 0)
        best, chosen = np.zeros(len(some)), []
        for _ in range(MOST_OFFSETS):
            gain = np.maximum(worth - best, 0).sum(1)
            i = int(gain.argmax())
            if gain[i] <= 0.001 * len(some):
                break
            chosen.append(i)
            best = np.maximum(best, worth[i])
        return np.ascontiguousarray(offsets[chosen])

    def _find_repeating(self) -> Array:
        """Offsets under which the known texture repeats: a fine search near, a coarse one far, multiples; then refined."""
        near, far = self._peaks(*NEAR), self._peaks(*FAR)
        offsets = np.concatenate([near, far, *(near[:4] * m for m in (2, 3, 4))])
        around = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 2)
        for size, every in ((2.0, COARSE), (1.0, COARSE), (0.5, COARSE), (0.25, 1)):
            tried = offsets[:, None] + size * self.step * around
            best = self.score(tried.reshape(-1, 2), every=every).reshape(-1, 9).argmax(1)
            offsets = tried[np.arange(len(best)), best]
        return offsets

    def _peaks(self, reach: int, spacing: int, radius: int, many: int) -> Array:
        """Best local maxima of the score on a (2 reach + 1)^2 grid, best first; the centre (no offset) is left out.

        Texture correlates alike there and back: half of the grid is scored.
        """
        ticks = np.arange(-reach, reach + 1)
        grid = np.stack(np.meshgrid(ticks, ticks), -1)
        offsets = (grid * (spacing * self.step)).reshape(-1, 2)
        half = self.score(offsets[: len(offsets) // 2 + 1], every=COARSE)
        score = np.concatenate([half, half[-2::-1]]).reshape(grid.shape[:2])
        score[np.abs(grid).max(-1) * spacing < 3] = 0
        window = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
        top = ((score > 0) & (score >= cv2.dilate(score, window))).ravel()
        order = np.argsort(-score.ravel()[top], kind="stable")[:many]
        return offsets[top][order]

    def _sample_to_known(self, rng: np.random.Generator) -> Array:
        """Offsets from random hole cells to random known cells, so that every cell can be reached."""
        many = 64
        start = self.centres[rng.integers(0, len(self.centres), many)]
        end = self.known[rng.integers(0, len(self.known), many)]
        w = np.maximum(start[:, 2], 1e-9)
        z = w / np.maximum(end[:, 2], 1e-9)
        one = np.ones(many)
        move = z[:, None] * np.stack([end[:, 0], end[:, 1], one], 1) - np.stack([start[:, 0], start[:, 1], one], 1)
        return (move / w[:, None]) @ np.linalg.pinv(self.axes)

    def assign_offsets(self, offsets: Array) -> CopiedDetail:
        """One offset per hole cell: good correlation, little change of scale, typical texture, cheap seams."""
        whole, fine, middle, color = (np.maximum(self.score(offsets, band), 0) for band in range(4))
        scale = kernels.change_of_scale(offsets, self.centres, self.sources)
        x, y = self._sources_of(self.centres[:, None], offsets @ self.axes)
        detail = cv2.remap(self.bands[0], x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        copied: Float32Array = np.ascontiguousarray(detail, np.float32)  # cells x offsets x 3
        squares = channel_squares(self.bands[0])
        typical = float(np.sqrt(squares[squares > 0].mean())) + 1e-3
        odd = np.clip(np.linalg.norm(copied, axis=-1) / typical - 1.5, 0, 3) * (1 - whole)
        cost = np.where(scale.T >= 0, (1 - whole) + 0.25 * scale.T + 0.3 * odd, 1e6).astype(np.float32)
        index = np.full(self.base_shape, -1, np.int32)
        index.ravel()[self.cells] = np.arange(len(self.cells))
        order = order_from_rim(index >= 0)
        chosen = np.full(len(cost), -1, np.int32)
        choices = kernels.Choices(np.ascontiguousarray(cost), copied, chosen)
        kernels.assign_cells(index, choices, order, SEAM_COST, 5)
        choice = np.full(self.base_shape, -1, np.int32)
        choice.ravel()[self.cells] = chosen
        grain = self._grain(offsets, chosen)
        gains = np.zeros((self.base_shape[0] * self.base_shape[1], 3), np.float32)
        gains[self.cells, 0] = fine[chosen] + grain * (1 - fine[chosen])
        gains[self.cells, 1] = np.clip((middle[chosen] - 0.2) / 0.6, 0, 1)
        gains[self.cells, 2] = np.clip((color[chosen] - 0.85) / 0.08, 0, 1)
        return CopiedDetail(self.axes, offsets, choice, gains.reshape(*self.base_shape, 3))

    def _grain(self, offsets: Array, chosen: NDArray[np.int32]) -> Float32Array:
        """Weights 0..1 of the uncorrelated fine detail that each hole cell copies.

        They leave GRAIN levels, and less of unusual detail: a handle or a picture on a wall is copied where the texture
        repeats, never as grain.
        """
        square = box_mean(channel_squares(self.bands[1]) / np.float32(3), self.region.sources.astype(np.float32), 3)
        usual = float(np.median(square.ravel()[self.some]))
        x, y = self._sources_of(self.centres, offsets[chosen] @ self.axes)
        copied = cv2.remap(square, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).ravel()
        ordinary = np.minimum(1, (usual + 1) / (copied + 1))
        return np.asarray(ordinary * np.minimum(1, GRAIN / np.sqrt(copied + 1e-3)), np.float32)

    def _sources_of(self, places: Array, move: Array) -> tuple[Float32Array, Float32Array]:
        """Columns and rows on the grid of cells to which homogeneous displacements `move` take places (... x 3, u, v and w)."""
        u, v, w = np.moveaxis(places, -1, 0)
        z = 1 + w * move[:, 2]
        z = np.where(z > 1e-3, z, 1) * self.grid.cell_size
        return ((u + w * move[:, 0]) / z - 0.5).astype(np.float32), ((v + w * move[:, 1]) / z - 0.5).astype(np.float32)


def channel_squares(band: Float32Array) -> Float32Array:
    """H x W: the sum of squares of three channels (H x W x 3); numpy's own sum over so few takes six times as long."""
    red, green, blue = np.moveaxis(band**2, 2, 0)
    return red + green + blue


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
