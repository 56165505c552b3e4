"""A small closed-form street (floor, wall, box, ball, sky) and what the method makes of it; shared by the tests next to it."""

from __future__ import annotations

import functools

import pytest

from dlama.completion.completion import Completion
from dlama.completion.recipes import RECIPES
from dlama.completion.verbs import remove, view
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.inpainters import FILLERS
from worlds import Box, Plane, Sphere, World

CAMERA = Camera.from_fov(128, 96, 65)
BALL = Sphere((0.2, 0.2, 2.2), 0.4)
SHAPES = (Plane((0, 1, 0), (0, 1, 0)), Box((-9, -0.6, 6), (9, 1, 7)), Box((-1.2, 0, 3), (-0.7, 1, 3.4)))
WORLD = World((*SHAPES, BALL))
MASK = WORLD.trace(CAMERA)[1] == 3

fillers = pytest.mark.parametrize("filler", [name for name, record in FILLERS.items() if not record.needs_model])
recipes = pytest.mark.parametrize("recipe", RECIPES)


def street(camera: Camera = CAMERA, sensor_holes: bool = True) -> RGBD:
    """Floor, wall, box, ball and sky; two sensor holes, one of them in the sky."""
    plain = WORLD.rgbd(camera)
    depth = plain.depth.copy()
    if sensor_holes:
        depth[75:82, 85:95] = depth[20:23, 30:34] = 0
    return RGBD(plain.color, depth, camera)


@functools.cache
def completed(recipe: str, filler: str, removing: bool, yaw: float) -> Completion:
    """One camera, shared by the tests that only look."""
    if removing:
        return remove(street(), MASK, yaw=yaw, filler=filler, recipe=recipe)
    return view(street(), yaw=yaw, filler=filler, recipe=recipe)
