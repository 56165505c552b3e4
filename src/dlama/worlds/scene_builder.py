"""Boxes, balls, tubes and panels with materials in; rows of shapes and texels for the ray caster out.

Arguments are metres: x right, up from the floor of the place where a prop stands, z forward. The rows hold OpenCV axes (y down).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import cv2
import numpy as np

from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import UInt8Array
from dlama.worlds.raycast import shape_rows as k
from dlama.worlds.raycast.shape_rows import GROUND_GROUP

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """How a surface looks: a layer of the builder's textures and how it lies on a shape."""

    layer: int
    tile: tuple[float, float] = (1.0, 1.0)
    """Metres a repeat (wrap, mirror) or repeats over the face (fit)."""
    mode: int = k.WRAP
    tint: Triple = (1.0, 1.0, 1.0)
    """Factors of linear r, g, b."""
    stain: float = 0.0
    """Strength 0..1 of broad, soft stains."""
    cut: bool = False
    """Alpha below 128 is no surface."""

    def with_tint(self, *tint: float) -> Material:
        """The same in another tint: one factor for all or three."""
        r, g, b = tint if len(tint) == 3 else (tint[0],) * 3
        return replace(self, tint=(r * self.tint[0], g * self.tint[1], b * self.tint[2]))


class SceneBuilder:
    """Collects shapes and textures. `at` sets the place and `group` the object to which the next shapes belong."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []
        self.layers: list[UInt8Array] = []
        self.groups = 2
        self._group = GROUND_GROUP
        self._casts = True
        self._origin = np.zeros(3)
        self._turn = np.eye(3)
        self._scale = 1.0

    def layer(self, picture: UInt8Array) -> int:
        """Adds a 256 x 256 x 4 texture; returns its number."""
        self.layers.append(picture)
        return len(self.layers) - 1

    @contextmanager
    def at(self, x: float, z: float, yaw: float = 0.0, up: float = 0.0, scale: float = 1.0) -> Iterator[None]:
        """Shapes are placed from here: x right, z forward, `up` metres above, turned about the vertical, enlarged."""
        before = self._origin, self._turn, self._scale
        self._origin = self._origin + self._scale * (self._turn @ np.array((x, -up, z)))
        self._turn, self._scale = self._turn @ rotation_of((yaw, 0, 0)), self._scale * scale
        yield
        self._origin, self._turn, self._scale = before

    @contextmanager
    def group(self, number: int | None = None, *, casts: bool = True) -> Iterator[int]:
        """Shapes belong to one object: a new one, or that of a number. `casts`: whether they cast shadows."""
        before = self._group, self._casts
        if number is None:
            number, self.groups = self.groups, self.groups + 1
        self._group, self._casts = number, casts
        yield number
        self._group, self._casts = before

    def box(self, at: Triple, size: Triple, material: Material, turn: Triple = (0, 0, 0)) -> None:
        """A box of size (x, height, z) whose base's centre is at (x, up, z); `turn`: yaw, pitch, roll in degrees."""
        self._add(k.BOX, (at[0], at[1] + size[1] / 2, at[2]), (size[0] / 2, size[1] / 2, size[2] / 2), material, turn)

    def ball(self, at: Triple, radii: Triple, material: Material, turn: Triple = (0, 0, 0)) -> None:
        """An ellipsoid whose centre is at (x, up, z)."""
        self._add(k.BALL, at, radii, material, turn)

    def tube(
        self,
        at: Triple,
        height: float,
        radius: float,
        material: Material,
        top: float | None = None,
        turn: Triple = (0, 0, 0),
    ) -> None:
        """A cylinder or, with another radius on top, a frustum or cone; its base's centre is at (x, up, z)."""
        half = (radius, height / 2, radius if top is None else top)
        self._add(k.TUBE, (at[0], at[1] + height / 2, at[2]), half, material, turn)

    def panel(self, at: Triple, size: tuple[float, float], material: Material, turn: Triple = (0, 0, 0)) -> None:
        """A rectangle of size (x, z), flat unless turned, whose centre is at (x, up, z)."""
        self._add(k.PANEL, at, (size[0] / 2, 0.0, size[1] / 2), material, turn)

    def _add(self, kind: int, at: Triple, half: Triple, m: Material, turn: Triple) -> None:
        centre = self._origin + self._scale * (self._turn @ np.array((at[0], -at[1], at[2])))
        half = (self._scale * half[0], self._scale * half[1], self._scale * half[2])
        world_from_local = self._turn @ rotation_of(turn) if any(turn) else self._turn
        across, down = (
            (0.0, 0.0) if m.mode == k.FIT else (at[0] / m.tile[0], -at[1] / m.tile[1])
        )  # pieces of a wall match
        contact = 0.0 if self._group == GROUND_GROUP else 0.4
        flags = (m.stain, self._group, self._casts, m.cut, across, down, contact)
        self.rows.append(
            [kind, *centre, *world_from_local.T.ravel(), *half, m.layer, *m.tile, m.mode, *m.tint, *map(float, flags)]
        )

    def shapes(self) -> Float64Array:
        """N x COLUMNS, one row a shape."""
        return np.array(self.rows, np.float64).reshape(-1, k.COLUMNS)

    def texels(self) -> UInt8Array:
        """L x P x 4: every layer with its coarser levels behind it."""
        out = np.empty((len(self.layers), k.TEXELS, 4), np.uint8)
        for pyramid, layer in zip(out, self.layers):
            start = 0
            level: np.ndarray = layer
            for n in range(k.LEVELS):
                side = k.SIDE >> n
                level = level if n == 0 else cv2.resize(level, (side, side), interpolation=cv2.INTER_AREA)
                pyramid[start : start + side * side] = level.reshape(-1, 4)
                start += side * side
        return out


def rotation_of(turn: Triple) -> Float64Array:
    """Rotation by yaw (to the left seen from above, as an orbit's camera turns), pitch (nose up) and roll, degrees."""
    (cy, sy), (cp, sp), (cr, sr) = ((math.cos(math.radians(a)), math.sin(math.radians(a))) for a in turn)
    yaw = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    pitch = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    roll = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    return yaw @ pitch @ roll
