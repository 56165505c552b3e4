"""Depth in; the supporting planes (ground, walls, tables) on which objects stand or hang out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.holes import dilate_mask
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.planes import (
    ESTIMATED_NOISE,
    KnownSurfaces,
    find_planes,
    label_known,
    noise_level,
    plane_normal,
)

SMALLEST_SUPPORT = 0.03
"""Least share of the picture of a supporting plane."""
LITTLE_BEHIND = 0.1
"""Largest share of a plane's border with something behind it, for it to be a support: the ground, a ceiling, a wall. Above it
the plane is the face of an object."""
NOISY = 6.0
"""Least difference of inverse depth of a pixel before or behind a plane, in standard deviations of the noise."""


@dataclass(frozen=True, eq=False)
class Planes(KnownSurfaces):
    """The planes of a picture, whose inverse depth keeps its noise."""

    behind: tuple[float, ...] = ()
    """Share of each plane's border with something behind it."""

    def value_at(self, number: int, row: int, column: int) -> float:
        """Inverse depth of the plane `number` (from 0) at a pixel's centre."""
        a, b, c = self.planes[number]
        return float(a * (column + 0.5) + b * (row + 0.5) + c)

    def share(self, number: int) -> float:
        """Share of the picture on plane `number`."""
        return float((self.label == number + 1).mean())


def find_planes_of_picture(rgbd: RGBD) -> Planes:
    """The planes of a picture, by decreasing support; none where depth is all missing or far."""
    w, valid, known = inverse_depth(rgbd.depth), rgbd.valid, ~rgbd.missing
    noise = noise_level(w, valid) if valid.any() else 0.0
    if rgbd.estimate is not None and valid.any():
        noise = max(noise, ESTIMATED_NOISE * float(np.median(w[valid])))
    planes = find_planes(w, valid, 0, noise)
    label = label_known(w, valid, rgbd.far, planes, noise)
    behind = tuple(behind_share(w, known, label == n + 1, plane, noise) for n, plane in enumerate(planes))
    return Planes(w, label, planes, noise, behind)


def behind_share(
    w: Float32Array, known: BoolArray, on_plane: BoolArray, plane: NDArray[np.float64], noise: float
) -> float:
    """Share (0..1) of a plane's border pixels that lie behind it: of the ground none, of a box's face most."""
    rows, columns = np.nonzero(known & ~on_plane & dilate_mask(on_plane, 2))
    if not len(rows):
        return 0.0
    value = plane[0] * (columns + 0.5) + plane[1] * (rows + 0.5) + plane[2]
    here = w[rows, columns]
    return float(np.mean((1.015 * here < value) & (here + NOISY * noise < value)))


def find_supports(found: Planes, seed: tuple[int, int] | None = None) -> BoolArray:
    """H x W, True on the planes that support the object at `seed` (row, column)."""
    chosen = [
        found.share(n) >= SMALLEST_SUPPORT
        and (seed is None or found.label[seed] != n + 1)
        and found.behind[n] <= LITTLE_BEHIND
        for n in range(len(found.planes))
    ]
    return np.asarray(np.array([False, *chosen])[np.maximum(found.label, 0)])


def is_level(found: Planes, number: int, camera: Camera) -> bool:
    """Whether plane `number` faces up, in a camera that is held upright."""
    normal = plane_normal(found.planes[number], camera)
    return bool(normal[1] >= 0.8 * np.linalg.norm(normal))  # within 37 degrees


def is_in_front(found: Planes, number: int, seed: tuple[int, int]) -> bool:
    """Whether (row, column) lies before plane `number`, by more than noise."""
    here, plane = found.inverse_depth[seed], found.value_at(number, *seed)
    return bool(here > 1.01 * plane and here > plane + NOISY * found.noise)


def is_ground(found: Planes, row: int, column: int) -> bool:
    """True where a pixel lies on a supporting plane, so on no object."""
    number = int(found.label[row, column]) - 1
    return number >= 0 and found.share(number) >= 4 * SMALLEST_SUPPORT and found.behind[number] <= LITTLE_BEHIND
