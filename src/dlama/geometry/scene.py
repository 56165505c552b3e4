"""Scene: layers of views that together are everything known and filled; renders and lifts as one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dlama.arguments import check
from dlama.errors import ShapeError
from dlama.geometry.cloud import concatenated
from dlama.geometry.figures.points import turning_points
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import BoolArray, counted
from dlama.geometry.view import HoleType, Origin, View

FILLED_BEFORE = (Origin.FILLED, Origin.DEPTH_FILLED)
"""Origins that the overlap of a layer with earlier filled ones keeps."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What is known of a scene: measured layers first, then what was filled, in the order it was fused.

    Each layer is a View whose holes contribute nothing. Earlier layers win where two lie on one surface.
    `objects` are layers that were taken out: they belong to c+ (eq. 10), not to c- (eq. 11).
    """

    layers: tuple[View, ...]
    """Background layers, the most trusted first; at least one."""
    objects: tuple[View, ...] = ()
    """Removed objects, as views from which all but the object is a hole."""
    numbers: tuple[int, ...] = ()
    """Of a scene of many frames: so many of the layers, the first ones, are frames of equal rank, which are merged pixel by
    pixel; their numbers as they were given. Empty: the scene of one picture."""
    gains: tuple[tuple[float, float, float], ...] = ()
    """For each of those frames: what its channels are multiplied by to have the scene's common brightness."""
    noise: tuple[float, float] = (0.0, 0.0)
    """Standard deviation of those frames' depth z, poses included: hypot(noise[0], noise[1] z^2) metres."""

    def __post_init__(self) -> None:
        for name in ("layers", "objects"):
            check(getattr(self, name), Iterable[View], name)
            object.__setattr__(self, name, tuple(getattr(self, name)))
            check(getattr(self, name), tuple[View, ...], name)
        for name in ("numbers", "gains"):
            check(getattr(self, name), Sequence[Any], name)
        if not self.layers:
            raise ShapeError("a scene has no layers; at least one is wanted")
        if not len(self.numbers) == len(self.gains) <= len(self.layers):
            raise ShapeError(
                f"a scene has {len(self.layers)} layers, {len(self.numbers)} numbers of frames and {len(self.gains)} gains; "
                "as many gains as numbers, and no more than layers, are wanted"
            )

    @property
    def measured(self) -> tuple[View, ...]:
        """The layers that are pictures: the frames, or the first layer."""
        return self.layers[: max(1, len(self.numbers))]

    def __repr__(self) -> str:
        frames = f"{counted(len(self.numbers), 'frame')}, " if self.numbers else ""
        layers, objects = frames + counted(len(self.layers), "layer"), counted(len(self.objects), "removed object")
        return f"Scene({layers}, {objects}, first layer {self.layers[0]!r})"

    def _repr_png_(self) -> bytes:
        return self.layers[0]._repr_png_()

    def _repr_html_(self) -> str:
        cloud = concatenated([lift(layer) for layer in self.layers])
        cam_from_world = self.layers[0].camera.cam_from_world
        return turning_points(repr(self), cloud.points, cloud.color, cloud.origin, cloud.confidence, cam_from_world)


def contribution(layer: View) -> BoolArray:
    """H x W, True at the pixels a layer adds to the scene's cloud: measured or filled here, not seen again.

    What was measured and is seen again has the origin REPROJECTED; what was filled before and is, no hole type.
    """
    filled_before = np.isin(layer.origin, FILLED_BEFORE) & (layer.hole_type == HoleType.NONE)
    return layer.valid & (layer.origin != Origin.REPROJECTED) & ~filled_before
