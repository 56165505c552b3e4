"""Streets, squares, parks, yards and corners: a plot and a random generator in; a set stage and its object out."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from dlama.geometry.trajectories import PIVOT_M
from dlama.worlds.materials.palette import Palette
from dlama.worlds.props.buildings import house, pavement, row, yard_wall
from dlama.worlds.props.street import STREET_OBJECTS, STREET_PROPS, Prop
from dlama.worlds.raycast.stage import GROUND_GROUP, OBJECT_GROUP, Stage

WALK_M = 0.12
"""Height of a pavement."""
CLEAR_M = 0.75
"""Nothing stands nearer to a camera of the orbit."""


class Plot:
    """A stage with what already stands on it, so that nothing stands in anything else or before a camera's nose."""

    def __init__(self, stage: Stage, palette: Palette, rng: Generator) -> None:
        self.stage, self.palette, self.rng = stage, palette, rng
        self._circles: list[tuple[float, float, float]] = [(0.0, PIVOT_M, 1.0)]
        self._fronts: list[tuple[float, float, float, float, float, float]] = []
        angles = np.radians(np.arange(-65, 66, 5))
        self._eyes = PIVOT_M * np.stack([np.sin(angles), 1 - np.cos(angles)], 1)

    def front(self, x: float, z: float, yaw_deg: float, left: float, right: float, walk: float = 0.0) -> None:
        """A row of buildings from `left` to `right` along the x axis of a place; `walk`: metres of pavement before it."""
        angle = math.radians(yaw_deg)
        self._fronts.append((x, z, angle, left, right, walk))

    def free(self, x: float, z: float, r: float) -> bool:
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
        count: int,
        xs: tuple[float, float],
        zs: tuple[float, float],
    ) -> None:
        """Puts up to `count` things of some kinds at random free places."""
        rng = self.rng
        for _ in range(count):
            prop, r = props[names[int(rng.integers(len(names)))]]
            for _ in range(12):
                x, z = float(rng.uniform(*xs)), float(rng.uniform(*zs))
                if self.free(x, z, r):
                    self._circles.append((x, z, r))
                    yaw = float(rng.choice((0, 90, 180, 270)) + rng.normal(0, 12))
                    with self.stage.at(x, z, yaw, self.floor(x, z)), self.stage.group():
                        prop(self.stage, self.palette, rng)
                    break

    def place_object(self, objects: tuple[Prop, ...], scale: tuple[float, float]) -> None:
        """The object of interest, near the point about which the cameras turn."""
        rng = self.rng
        x, z = float(rng.uniform(-0.3, 0.3)), PIVOT_M + float(rng.uniform(-0.4, 0.4))
        place = self.stage.at(x, z, float(rng.uniform(-180, 180)), self.floor(x, z), float(rng.uniform(*scale)))
        with place, self.stage.group(OBJECT_GROUP):
            objects[int(rng.integers(len(objects)))](self.stage, self.palette, rng)


def ground(plot: Plot, *kinds: str) -> None:
    """The ground, to the horizon; below everything, it shades nothing."""
    with plot.stage.group(GROUND_GROUP, casts=False):
        plot.stage.panel((0, 0, 0), (1600, 1600), plot.palette(*kinds))


def facade(plot: Plot, x: float, z: float, yaw_deg: float, left: float, right: float, walk: float) -> None:
    """A row of houses behind a pavement."""
    plot.front(x, z, yaw_deg, left, right, walk)
    with plot.stage.at(x, z, yaw_deg):
        row(plot.stage, plot.palette, plot.rng, left, right)
        if walk > 0:
            pavement(plot.stage, plot.palette, left, right, walk, plot.palette("concrete", "stones"))


def markings(plot: Plot, z: float) -> None:
    """Lines on the road, 3 mm thick: a dashed middle line, a zebra crossing or parking bays."""
    stage, rng, paint = plot.stage, plot.rng, plot.palette("plain").tinted(0.9)
    kind = int(rng.integers(4))
    if kind == 0:
        for n in range(-6, 7):
            stage.box((2.4 * n + float(rng.uniform(0, 0.1)), 0, z), (1.3, 0.003, 0.12), paint)
    elif kind == 1:
        x = float(rng.uniform(-4, 4))
        for n in range(7):
            stage.box((x + 0.75 * (n - 3), 0, z), (0.42, 0.003, 2.4), paint)
    elif kind == 2:
        for n in range(-4, 5):
            stage.box((2.4 * n, 0, z), (0.1, 0.003, 3.6), paint.tinted(1.0, 0.85, 0.4))


def square(plot: Plot) -> None:
    """Houses across the street, at times round three sides."""
    rng = plot.rng
    ground(plot, "asphalt", "paving", "paving", "gravel")
    far, walk = float(rng.uniform(6, 11.5)), float(rng.uniform(1.0, 2.4))
    sides = [float(rng.uniform(5.5, 11)) if rng.random() < 0.65 else 0.0 for _ in range(2)]
    left, right = sides[0] or 22.0, sides[1] or 22.0
    facade(plot, 0, far, 0, -left - 1, right + 1, walk)
    if sides[0]:
        facade(plot, -left, 0, 90, -7, far - float(rng.choice((0, 4))), 0)
    if sides[1]:
        facade(plot, right, 0, -90, -far + float(rng.choice((0, 4))), 7, 0)
    markings(plot, float(rng.uniform(3.5, max(3.6, far - walk - 0.5))))
    names = [*STREET_PROPS, "tree", "lamp", "planter", "bench", "bin", "bollard"]
    plot.scatter(STREET_PROPS, names, int(rng.integers(6, 14)), (-min(left, 9) + 0.5, min(right, 9) - 0.5), (3.2, far))


def canyon(plot: Plot) -> None:
    """A street between two rows of houses, closed at its far end or open to the sky."""
    rng = plot.rng
    ground(plot, "asphalt", "asphalt", "paving")
    left, right, end = (float(rng.uniform(*span)) for span in ((3.6, 7), (3.6, 7), (14, 34)))
    walk = float(rng.uniform(0.9, 1.5))
    facade(plot, -left, 0, 90, -8, end, walk)
    facade(plot, right, 0, -90, -end, 8, walk)
    if rng.random() < 0.6:
        facade(plot, 0, end + 3, 0, -12, 12, 0)
    with plot.stage.at(float(rng.uniform(-0.5, 0.5)), 0, 90):
        markings(plot, 0.0)
    names = [*STREET_PROPS, "lamp", "tree", "bin", "bollard", "planter", "car"]
    plot.scatter(STREET_PROPS, names, int(rng.integers(8, 18)), (-left + 0.3, right - 0.3), (3.0, 14))


def park(plot: Plot) -> None:
    """A lawn with a path, trees and benches; houses far behind."""
    rng, stage, palette = plot.rng, plot.stage, plot.palette
    ground(plot, "grass", "grass", "gravel")
    with stage.at(float(rng.uniform(-1.5, 1.5)), 3, float(rng.uniform(-70, 70))):
        stage.box((0, 0, 0), (float(rng.uniform(1.6, 3)), 0.012, 60), palette("gravel", "paving", "asphalt"))
    far = float(rng.uniform(11, 26))
    facade(plot, 0, far, float(rng.uniform(-15, 15)), -26, 26, 1.5)
    if rng.random() < 0.7:
        z = float(rng.uniform(5.5, 10))
        with stage.at(0, z, float(rng.uniform(-12, 12))), stage.group():
            yard_wall(stage, palette, rng, -14, 14)
        plot.front(0, z, 0, -14, 14)
    names = [
        "tree",
        "tree",
        "tree",
        "conifer",
        "bush",
        "bush",
        "hedge",
        "bench",
        "lamp",
        "statue",
        "planter",
        "bin",
        "bicycle",
    ]
    plot.scatter(STREET_PROPS, names, int(rng.integers(10, 20)), (-10, 10), (1.5, min(far - 1, 13)))


def yard(plot: Plot) -> None:
    """A yard between a house and walls, with containers and goods."""
    rng, stage, palette = plot.rng, plot.stage, plot.palette
    ground(plot, "asphalt", "paving", "gravel")
    far, left, right = (float(rng.uniform(*span)) for span in ((5.5, 9), (4.2, 8), (4.2, 8)))
    facade(plot, 0, far, 0, -left - 0.5, right + 0.5, 0)
    for x, yaw, low, high in ((-left, 90, -7.0, far), (right, -90, -far, 7.0)):
        plot.front(x, 0, yaw, low, high)
        with stage.at(x, 0, yaw), stage.group():
            if rng.random() < 0.4:
                row(stage, palette, rng, low, high)
            else:
                yard_wall(stage, palette, rng, low, high)
    facade(plot, 0, float(rng.uniform(24, 34)), 0, -34, 34, 0)
    markings(plot, float(rng.uniform(3.2, far - 1)))
    names = [
        "dumpster",
        "crates",
        "pallet",
        "barrel",
        "cone",
        "barrier",
        "car",
        "bicycle",
        "bin",
        "planter",
        "advert",
        "crates",
    ]
    plot.scatter(STREET_PROPS, names, int(rng.integers(7, 14)), (-left, right), (3, far))


def corner(plot: Plot) -> None:
    """The corner of a block between two streets."""
    rng, stage = plot.rng, plot.stage
    ground(plot, "asphalt", "paving")
    x, z, yaw = (float(rng.uniform(*span)) for span in ((-2.5, 2.5), (6, 9), (30, 60)))
    walk = float(rng.uniform(1, 1.6))
    facade(plot, x, z, yaw, 0, 16, walk)
    facade(plot, x, z, yaw - 90, -16, 0, walk)
    facade(plot, -float(rng.uniform(9, 13)), 0, 90, -6, 26, 0)
    facade(plot, float(rng.uniform(9, 13)), 0, -90, -26, 6, 0)
    with stage.at(float(rng.uniform(-4, 4)), 3, float(rng.uniform(-50, 50))):
        markings(plot, 0.0)
    plot.scatter(STREET_PROPS, [*STREET_PROPS, "lamp", "tree", "car"], int(rng.integers(7, 15)), (-9, 9), (3, 10))


def shed(plot: Plot) -> None:
    """One free-standing house on open ground, few things round it, much sky."""
    rng, stage = plot.rng, plot.stage
    ground(plot, "grass", "gravel", "asphalt")
    far, width = float(rng.uniform(6, 10)), float(rng.uniform(5, 9))
    x, yaw = float(rng.uniform(-2, 2)), float(rng.uniform(-25, 25))
    plot.front(x, far, yaw, -width / 2, width / 2)
    with stage.at(x, far, yaw), stage.group():
        house(stage, plot.palette, rng, width)
    for side in (-1, 1):
        if rng.random() < 0.6:
            facade(plot, side * float(rng.uniform(14, 20)), 8, -90.0 * side, -14, 14, 0)
    plot.scatter(STREET_PROPS, [*STREET_PROPS, "tree", "bush", "hedge"], int(rng.integers(8, 16)), (-10, 10), (1.5, 14))


LAYOUTS: tuple[Callable[[Plot], None], ...] = (square, square, canyon, park, yard, corner, shed)


def street(plot: Plot) -> None:
    """One of the layouts, with the object of interest."""
    LAYOUTS[int(plot.rng.integers(len(LAYOUTS)))](plot)
    plot.place_object(STREET_OBJECTS, (0.95, 1.35))
