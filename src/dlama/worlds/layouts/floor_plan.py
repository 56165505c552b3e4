"""Where objects stand: rows of buildings and props in; free places out, and props set on them."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from dlama.geometry.motion.trajectories import PIVOT_M
from dlama.worlds.materials.palette import Palette
from dlama.worlds.props.street import Prop
from dlama.worlds.raycast.shape_rows import OBJECT_GROUP
from dlama.worlds.scene_builder import SceneBuilder

WALK_M = 0.12
"""Height of a pavement."""
CLEAR_M = 0.75
"""Nothing stands nearer to a camera of the orbit."""


class FloorPlan:
    """A scene being built and where objects stand in it: nothing is placed inside another object, or right before a camera."""

    def __init__(self, builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
        self.builder, self.palette, self.rng = builder, palette, rng
        self._circles: list[tuple[float, float, float]] = [(0.0, PIVOT_M, 1.0)]
        self._fronts: list[tuple[float, float, float, float, float, float]] = []
        angles = np.radians(np.arange(-65, 66, 5))
        self._eyes = PIVOT_M * np.stack([np.sin(angles), 1 - np.cos(angles)], 1)

    def building_row(self, x: float, z: float, yaw: float, left: float, right: float, walk: float = 0.0) -> None:
        """A row of buildings from `left` to `right` along the x axis of a place; `walk`: metres of pavement before it."""
        angle = math.radians(yaw)
        self._fronts.append((x, z, angle, left, right, walk))

    def is_free(self, x: float, z: float, r: float) -> bool:
        """True if a circle stands clear of the cameras, the object, the buildings and everything placed before."""
        if np.hypot(self._eyes[:, 0] - x, self._eyes[:, 1] - z).min() < r + CLEAR_M:
            return False
        if any(math.hypot(x - a, z - b) < r + c for a, b, c in self._circles):
            return False
        return not any(u > left - r and u < right + r and v > -r - 0.15 for u, v, left, right, _ in self._local(x, z))

    def floor(self, x: float, z: float) -> float:
        """Height of the pavement there, 0 on the road."""
        on_walk = any(left < u < right and -walk < v < 0.1 for u, v, left, right, walk in self._local(x, z))
        return WALK_M if on_walk else 0.0

    def _local(self, x: float, z: float) -> list[tuple[float, float, float, float, float]]:
        found = []
        for fx, fz, angle, left, right, walk in self._fronts:
            c, s = math.cos(angle), math.sin(angle)
            found.append((c * (x - fx) + s * (z - fz), c * (z - fz) - s * (x - fx), left, right, walk))
        return found

    def scatter(
        self,
        props: dict[str, tuple[Prop, float]],
        names: list[str],
        counts: tuple[int, int],
        xs: tuple[float, float],
        zs: tuple[float, float],
    ) -> None:
        """Puts objects of some kinds at random free places: up to a number from the first of `counts` on, below the second."""
        rng = self.rng
        for _ in range(rng.integers(*counts)):
            prop, r = props[names[rng.integers(len(names))]]
            for _ in range(12):
                x, z = rng.uniform(*xs), rng.uniform(*zs)
                if self.is_free(x, z, r):
                    self._circles.append((x, z, r))
                    yaw = rng.choice((0, 90, 180, 270)) + rng.normal(0, 12)
                    with self.builder.at(x, z, yaw, self.floor(x, z)), self.builder.group():
                        prop(self.builder, self.palette, rng)
                    break

    def place_object(self, objects: tuple[Prop, ...], scale: tuple[float, float]) -> None:
        """The object of interest, near the point about which the cameras turn."""
        rng = self.rng
        x, z = rng.uniform(-0.3, 0.3), PIVOT_M + rng.uniform(-0.4, 0.4)
        place = self.builder.at(x, z, rng.uniform(-180, 180), self.floor(x, z), rng.uniform(*scale))
        with place, self.builder.group(OBJECT_GROUP):
            objects[rng.integers(len(objects))](self.builder, self.palette, rng)
