"""Texture shifts: one surface of the hole in, which 3D translations to copy its texture by, where and how strongly, out.

After He & Sun, "Statistics of patch offsets for image completion" (2012), with offsets that are translations in the plane,
scored by how well the *known* texture agrees with itself under them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlama.inpainters.layered.canvas import Bases, Canvas, Surface

Array = NDArray[np.float64]

SEARCHED = 0.003
"""Planes that fill less of the picture than this are not searched for a period."""
SAMPLES = 320
"""Known places at which a shift is scored."""
KEPT = 28
"""Shifts a surface may use."""
GRAIN_NEAR, GRAIN_FAR = 0.3, 0.15
"""Share of fine detail that is kept though it does not correlate: beside known texture, and far from it."""
GRAIN_REACH = 12.0
"""Cells over which the first falls to the second."""
SEAM = 0.01
"""Cost of a seam per grey level of difference."""


@dataclass(frozen=True)
class Detail:
    """Where each cell of a surface copies its texture from."""

    axes: Array
    """2 x 3: homogeneous pixel displacement per unit of shift."""
    shifts: Array
    """N x 2."""
    pick: NDArray[np.int32]
    """Cell grid: index of the shift, -1 = none."""
    gains: NDArray[np.float32]
    """Cell grid x 3: how much of the fine band, of the middle band and of the colour as it stands is believed."""


def detail_for(canvas: Canvas, surface: Surface, bases: Bases, rng: np.random.Generator) -> Detail:
    """Shifts for one surface; an empty answer (base only) where nothing can be copied."""
    grid = bases[0].shape[:2]
    nothing = Detail(np.zeros((2, 3)), np.zeros((1, 2)), np.full(grid, -1, np.int32), np.zeros((*grid, 3), np.float32))
    # Copied sky ends in hard edges, and where there is no plane, neither scale nor slant is known: measured, no gain.
    if surface.kind < 1:
        return nothing
    own = surface.sources
    if own.sum() < 24 or len(surface.pixels) < 2 * canvas.cell**2:
        return nothing
    search = _Search(canvas, surface, own, bases, _axes(canvas, surface, rng), rng)
    shifts = search.chosen_shifts(rng)
    return search.assigned(shifts) if len(shifts) else nothing


def _axes(canvas: Canvas, surface: Surface, rng: np.random.Generator) -> Array:
    """K e for two directions e of the plane, per metre; the plane is fitted to known and hole pixels of the surface."""
    factor, width = canvas.factor, canvas.hole.shape[1]
    y, x = np.nonzero(canvas.sources == surface.kind)
    y, x = (
        np.minimum(y * factor + factor // 2, canvas.hole.shape[0] - 1),
        np.minimum(x * factor + factor // 2, width - 1),
    )
    flat = np.concatenate([(y * width + x)[canvas.source[y, x] == surface.kind], surface.pixels])
    flat = flat[rng.integers(0, len(flat), min(len(flat), 4000))]
    points = np.stack([flat % width + 0.5, flat // width + 0.5, np.ones(len(flat))], 1)
    plane = np.linalg.lstsq(points / canvas.inverse_depth.ravel()[flat][:, None], np.ones(len(flat)), rcond=None)[0]
    normal = canvas.camera.K.T @ plane
    normal /= np.linalg.norm(normal)
    first = np.cross(normal, [0, 1, 0] if abs(normal[1]) < 0.9 else [0, 0, 1])
    first /= np.linalg.norm(first)
    return np.stack([canvas.camera.K @ first, canvas.camera.K @ np.cross(normal, first)])


class _Search:
    """One surface's known texture, ready to be compared with itself."""

    def __init__(
        self, canvas: Canvas, surface: Surface, own: NDArray, bases: Bases, axes: Array, rng: np.random.Generator
    ) -> None:
        self.canvas, self.surface, self.axes = canvas, surface, axes
        self.grid = bases[0].shape[:2]
        self.bands = [self._above(own, bases[1]), self._above(own, bases[0])]
        self.bands.append(self.bands[0] - self.bands[1])
        self.bands.append(((canvas.colors - canvas.colors[own].mean(0)) * own[..., None]).astype(np.float32))
        self.known = self._known(own)
        self.cells, self.centres = self._hole_cells()
        self.points = self._samples(rng)
        self.step = self._step()

    def _above(self, own: NDArray, base: NDArray) -> NDArray[np.float32]:
        """Known colour minus a base, on the work grid; 0 where unknown."""
        import cv2

        rows, cols = own.shape
        fine = cv2.resize(base, (2 * base.shape[1], 2 * base.shape[0]), interpolation=cv2.INTER_LINEAR)[:rows, :cols]
        return np.ascontiguousarray((self.canvas.colors - fine.reshape(rows, cols, 3)) * own[..., None], np.float32)

    def _known(self, own: NDArray) -> Array:
        """N x 3: u, v, inverse depth of the known cells' centres."""
        y, x = np.nonzero(own)
        factor = self.canvas.factor
        return np.stack([(x + 0.5) * factor, (y + 0.5) * factor, self.canvas.depths[y, x]], 1).astype(np.float64)

    def _hole_cells(self) -> tuple[NDArray[np.int64], Array]:
        """Flat indices of the hole's cells, and N x 3: u, v, inverse depth of their hole pixels' centre of mass."""
        y, x = np.divmod(self.surface.pixels, self.canvas.hole.shape[1])
        flat = (y // self.canvas.cell) * self.grid[1] + x // self.canvas.cell
        count = np.bincount(flat)
        cells = np.flatnonzero(count)
        w = self.canvas.inverse_depth.ravel()[self.surface.pixels]
        sums = [np.bincount(flat, value)[cells] for value in (x + 0.5, y + 0.5, w)]
        return cells, np.stack(sums, 1) / count[cells][:, None]

    def _samples(self, rng: np.random.Generator) -> Array:
        """Known places: half of them from the quarter that is nearest to the hole, half from anywhere."""
        import cv2

        away = np.ones(self.grid, np.uint8)
        away.ravel()[self.cells] = 0
        distance = cv2.distanceTransform(away, cv2.DIST_L2, 3)
        cell = self.canvas.cell
        there = distance[(self.known[:, 1] // cell).astype(int), (self.known[:, 0] // cell).astype(int)]
        near = np.argsort(there, kind="stable")[: max(24, len(there) // 4)]
        half = min(len(there), SAMPLES) // 2
        pick = np.concatenate([near[rng.integers(0, len(near), half)], rng.integers(0, len(there), half)])
        return self.known[pick]

    def _step(self) -> Array:
        """Shift along each axis that moves a typical known place by one work cell."""
        u, v, w = self.points.T
        moves = [np.quantile(w * np.hypot(a[0] - u * a[2], a[1] - v * a[2]), 0.6) for a in self.axes]
        return self.canvas.factor / np.maximum(moves, 1e-9)

    def score(self, shifts: Array, band: int = 0) -> NDArray[np.float32]:
        """Correlation of the known texture with itself under each shift; 0 all detail, 1 fine, 2 middle, 3 colour itself."""
        canvas, need = self.canvas, max(12, len(self.points) // 12)
        shifts = np.ascontiguousarray(shifts, np.float64)
        return canvas.kernels.correlate(shifts, self.points, self.bands[band], *self._where(), need)

    def _where(self) -> tuple:
        canvas, surface = self.canvas, self.surface
        return canvas.factor, canvas.depths, canvas.sources, surface.kind, self.axes

    def chosen_shifts(self, rng: np.random.Generator) -> Array:
        """The few shifts that together bring every hole cell a good source (greedy cover)."""
        found = self._repeats() if self._worth_searching() else np.zeros((0, 2))
        shifts = np.ascontiguousarray(np.concatenate([found, self._to_known(rng)]))
        some = np.ascontiguousarray(self.centres[rng.permutation(len(self.centres))[:600]])
        scale = self.canvas.kernels.change_of_scale(shifts, some, *self._where())
        worth = np.maximum(0.3 + self.score(shifts)[:, None] - 0.25 * scale, 0.01) * (scale >= 0)
        best, chosen = np.zeros(len(some)), []
        for _ in range(KEPT):
            gain = np.maximum(worth - best, 0).sum(1)
            i = int(gain.argmax())
            if gain[i] <= 0.001 * len(some):
                break
            chosen.append(i)
            best = np.maximum(best, worth[i])
        return np.ascontiguousarray(shifts[chosen])

    def _worth_searching(self) -> bool:
        return len(self.surface.pixels) >= SEARCHED * self.canvas.hole.size

    def _repeats(self) -> Array:
        """Shifts under which the known texture repeats: a fine search near, a coarse one far, multiples; then refined."""
        short, far = self._peaks(20, 1, 3, 24), self._peaks(36, 5, 2, 60)
        lattice = [short[:4] * m for m in (2, 3, 4, 6, 8)]
        shifts = np.concatenate([short, far, *lattice])
        around = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 2)
        for size in (2.0, 1.0, 0.5, 0.25):
            tried = shifts[:, None] + size * self.step * around
            best = self.score(tried.reshape(-1, 2)).reshape(-1, 9).argmax(1)
            shifts = tried[np.arange(len(best)), best]
        return shifts

    def _peaks(self, reach: int, spacing: int, radius: int, many: int) -> Array:
        """Best local maxima of the score on a (2 reach + 1)^2 grid, best first; the centre (no shift) is left out."""
        import cv2

        ticks = np.arange(-reach, reach + 1)
        grid = np.stack(np.meshgrid(ticks, ticks), -1)
        shifts = grid * (spacing * self.step)
        score = self.score(shifts.reshape(-1, 2)).reshape(grid.shape[:2])
        score[np.abs(grid).max(-1) * spacing < 3] = 0
        window = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
        top = (score > 0) & (score >= cv2.dilate(score, window))
        order = np.argsort(-score[top], kind="stable")[:many]
        return shifts[top][order]

    def _to_known(self, rng: np.random.Generator, many: int = 64) -> Array:
        """Shifts from random hole cells to random known cells, so that every cell can be reached."""
        start = self.centres[rng.integers(0, len(self.centres), many)]
        end = self.known[rng.integers(0, len(self.known), many)]
        w = np.maximum(start[:, 2], 1e-9)
        z = w / np.maximum(end[:, 2], 1e-9)
        one = np.ones(many)
        move = z[:, None] * np.stack([end[:, 0], end[:, 1], one], 1) - np.stack([start[:, 0], start[:, 1], one], 1)
        return (move / w[:, None]) @ np.linalg.pinv(self.axes)

    def assigned(self, shifts: Array) -> Detail:
        """One shift per hole cell: good correlation, little change of scale, typical texture, cheap seams."""
        kernels = self.canvas.kernels
        whole, fine, middle, color = (np.maximum(self.score(shifts, band), 0) for band in range(4))
        scale = kernels.change_of_scale(shifts, self.centres, *self._where())
        brought = self._brought(shifts)
        typical = float(np.sqrt((self.bands[0][self.bands[0].any(-1)] ** 2).sum(-1).mean())) + 1e-3
        odd = np.clip(np.linalg.norm(brought, axis=-1) / typical - 1.5, 0, 3) * (1 - whole)
        cost = np.where(scale.T >= 0, (1 - whole) + 0.25 * scale.T + 0.3 * odd, 1e6).astype(np.float32)
        index = np.full(self.grid, -1, np.int32)
        index.ravel()[self.cells] = np.arange(len(self.cells))
        depth = self._inward(index)
        order = self.cells[np.argsort(depth, kind="stable")]
        chosen = kernels.assign(index, np.ascontiguousarray(cost), brought, order, SEAM, 5)
        pick = np.full(self.grid, -1, np.int32)
        pick.ravel()[self.cells] = chosen
        grain = GRAIN_FAR + (GRAIN_NEAR - GRAIN_FAR) * np.exp(-depth / GRAIN_REACH)
        gains = np.zeros((self.grid[0] * self.grid[1], 3), np.float32)
        gains[self.cells, 0] = fine[chosen] + grain * (1 - fine[chosen])
        gains[self.cells, 1] = np.clip((middle[chosen] - 0.2) / 0.6, 0, 1)
        gains[self.cells, 2] = np.clip((color[chosen] - 0.85) / 0.08, 0, 1)
        return Detail(self.axes, shifts, pick, gains.reshape(*self.grid, 3))

    def _inward(self, index: NDArray[np.int32]) -> NDArray[np.float32]:
        """Distance of every hole cell from the surface's rim, in cells."""
        import cv2

        distance = cv2.distanceTransform((index >= 0).astype(np.uint8), cv2.DIST_L2, 3)
        return np.ascontiguousarray(distance.ravel()[self.cells], np.float32)

    def _brought(self, shifts: Array) -> NDArray[np.float32]:
        """Cells x shifts x 3: the detail that each shift would bring to each hole cell."""
        import cv2

        w = self.centres[:, 2:]
        move = shifts @ self.axes
        z = 1 + w * move[:, 2]
        z = np.where(z > 1e-3, z, 1) * self.canvas.factor
        x = ((self.centres[:, :1] + w * move[:, 0]) / z - 0.5).astype(np.float32)
        y = ((self.centres[:, 1:2] + w * move[:, 1]) / z - 0.5).astype(np.float32)
        picture = cv2.remap(self.bands[0], x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.ascontiguousarray(picture, np.float32)
