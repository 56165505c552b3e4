"""An object's points over the surface in; the shapes it casts under the likeliest lights, with their probabilities, out.

A cast shadow on a plane is the object's shape projected along the light. It is darker than the lit surface by a nearly constant
ratio.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import dilate_mask, morphological_close, square
from dlama.geometry.projection import project_to_pixels, rays
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.shadows.ground import Ground, StandingObject, measure_object
from dlama.perception.shadows.search import CastShape, best_direction

FEATURES = "strength over next best", "strength", "step", "even and clear", "contrast", "off in colour", "over pattern"
"""Features of a cast shape from which its probability follows: `shape_features`."""
WEIGHTS = 3.027, 1.401, 0.903, 3.322, 0.765, -1.893, 0.079, -1.249
"""Of FEATURES, and a constant; fitted on 120 worlds by `python benchmarks/shadows.py`."""
SMALLEST_PX = 25
"""Fewer points of an object, or pixels of a shape or its ring, are ignored."""
LEAST_PROBABILITY = 0.15
"""Value of a cast shape of probability 0; a certain one has 1."""
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
    made = find_cast_shape(rgbd, usable, caster)
    if made is None:
        return None
    shape, features = made
    probability = 1 / (1 + np.exp(-(features @ np.array(WEIGHTS[:-1]) + WEIGHTS[-1])))  # logistic regression
    return LEAST_PROBABILITY + (1 - LEAST_PROBABILITY) * float(probability), shape


def find_cast_shape(
    rgbd: RGBD, usable: BoolArray, caster: StandingObject
) -> tuple[BoolArray, NDArray[np.float64]] | None:
    """The shape cast by the best light (H x W), and its FEATURES. None: there is none."""
    found = best_direction(caster, rgbd, usable)
    if found is None:
        return None
    shape = cast_shape(caster, found.over, rgbd, usable)
    error_px = 4 + round(0.1 * float(np.sqrt(shape.sum())))  # of its position
    ring = usable & dilate_mask(shape, error_px + 4) & ~dilate_mask(shape, 4)
    if shape.sum() < SMALLEST_PX or ring.sum() < SMALLEST_PX:
        return None
    return shape, np.array(shape_features(rgbd, shape, ring, found))


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


def shape_features(rgbd: RGBD, shape: BoolArray, ring: BoolArray, found: CastShape) -> tuple[float, ...]:
    """FEATURES of a cast shape. ring: H x W, True on the surface round it."""
    level = np.log(rgbd.color.astype(np.float32) + 4)
    inside, outside = level[shape], level[ring]
    ratio = outside.mean(0) - inside.mean(0)
    contrast = float(ratio.mean())
    middle = float(np.median(inside[:, 1]) + np.median(outside[:, 1])) / 2
    return (
        float(np.log(max(found.strength / max(found.next_best, 1.0), 0.1))),
        float(np.log(max(found.strength, 1.0))),
        float(np.log(max(found.step, 0.003))),
        float((inside[:, 1] < middle).mean() + (outside[:, 1] > middle).mean()) - 1,
        float(np.log(np.clip(contrast, 0.03, 1.0))),
        min(float(np.abs(ratio - ratio[1]).max()) / max(contrast, 0.05), 2.0),
        float(np.clip(contrast / max(float(outside[:, 1].std()), 0.05), 0, 4)),
    )


def cast_shape(caster: StandingObject, over: NDArray[np.float64], rgbd: RGBD, usable: BoolArray) -> BoolArray:
    """H x W shape cast on `usable` by a light (metres over the surface for each metre of height), gaps closed."""
    shape = np.zeros(usable.shape, np.bool_)
    points = caster.base + caster.rise[:, None] * over
    row, column, z, inside = project_to_pixels(points, rgbd.camera.at(np.eye(4)))
    inside &= z > 1e-3
    shape[row[inside], column[inside]] = True
    return np.asarray(usable & morphological_close(shape, square(9)))
