"""An object's points over the surface in; the shapes it casts under the likeliest lights, with their probabilities, out.

A cast shadow on a plane is the object's shape projected along the light. It is darker than the lit surface by a nearly constant
ratio.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import morphological_close, square
from dlama.geometry.projection import project_to_pixels, rays
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.shadows.ground import Ground, StandingObject, measure_object
from dlama.perception.shadows.search import best_direction

SMALLEST_PX = 25
"""Fewer points of an object, or pixels of a shadow, are ignored."""
OWN_LIGHT = 0.6
"""Probability of the shape that the best light of the object casts; one fitted to seven features of the shape found no more
shadows."""
TALLEST, LOWEST = 4.0, 0.04
"""Heights over the surface, in object heights, outside which points do not count for the common light."""
COMMON_POINTS = 4000
"""Most points, of all objects on the surface, in the search of their common light."""
STRONG = 20.0
"""Strength of a shape under the common light that counts as certain."""


def find_cast_shapes(
    rgbd: RGBD, ground: Ground, usable: BoolArray, caster: StandingObject, tall: float
) -> list[tuple[float, BoolArray] | None]:
    """Probability and H x W shape of: the best light of the object, and the common light of all objects. usable: H x W, True
    where the surface is seen; tall: metres."""
    if len(caster.base) < SMALLEST_PX:
        return [None, None]
    return [find_own_light(rgbd, usable, caster), find_common_light(rgbd, ground, usable, caster, tall)]


def find_own_light(rgbd: RGBD, usable: BoolArray, caster: StandingObject) -> tuple[float, BoolArray] | None:
    """The shape cast by the best light of the object. None: there is none."""
    found = best_direction(caster, rgbd, usable)
    return None if found is None else (OWN_LIGHT, cast_shape(caster, found.over, rgbd, usable))


def find_common_light(
    rgbd: RGBD, ground: Ground, usable: BoolArray, caster: StandingObject, tall: float
) -> tuple[float, BoolArray] | None:
    """The shape cast by the light that explains the shadows of all objects on the surface."""
    there = rgbd.valid & ~ground.surface
    every = rays(rgbd.camera)[there] * rgbd.depth[there][:, None]
    height = (1 - every @ ground.normal) / float(np.linalg.norm(ground.normal))
    keep = np.flatnonzero((height > LOWEST * tall) & (height < TALLEST * tall))
    keep = keep[:: max(1, len(keep) // COMMON_POINTS)]
    if len(keep) < SMALLEST_PX:
        return None
    others = measure_object(every[keep], height[keep], ground)
    found = best_direction(others, rgbd, usable)
    if found is None:
        return None
    return float(np.tanh(found.strength / STRONG)), cast_shape(caster, found.over, rgbd, usable)


def cast_shape(caster: StandingObject, over: NDArray[np.float64], rgbd: RGBD, usable: BoolArray) -> BoolArray:
    """H x W shape cast on `usable` by a light (metres over the surface for each metre of height), gaps closed."""
    shape = np.zeros(usable.shape, np.bool_)
    points = caster.base + caster.rise[:, None] * over
    row, column, z, inside = project_to_pixels(points, rgbd.camera.at(np.eye(4)))
    inside &= z > 1e-3
    shape[row[inside], column[inside]] = True
    return np.asarray(usable & morphological_close(shape, square(9)))
