"""Worlds whose objects stand on objects, against the plain worlds of the same seeds."""

from __future__ import annotations

import numpy as np

from click_worlds import ClickWorld, objects_in_sight
from dlama.worlds.dataset import world


def test_without_stands_the_picture_is_the_world_s_own() -> None:
    """Oracle: `world(seed)`. Bit for bit; what lies on a table is the only thing that is numbered anew."""
    for seed in (3, 5):
        made, plain = ClickWorld(seed), world(seed)
        camera = plain.camera(10, 96, 70)
        scene, seen = made.scene(camera), plain.raycast(camera)
        np.testing.assert_array_equal(scene.frame.color, seen.color)
        np.testing.assert_array_equal(scene.frame.depth, seen.depth)
        np.testing.assert_array_equal(scene.mask(plain.object_index) | scene.on_it(1), seen.group == 1)


def test_stands_carry_objects() -> None:
    """Laws: each stand is an object of its own, `with_stand` holds both, and no object in sight is ground or wall."""
    made = ClickWorld(78, stands=True)
    scene = made.scene(made.world.camera(10, 128, 75))
    chosen = objects_in_sight(scene, 0.003, 0.2)
    standing = [number for number in chosen if number in scene.stands_on]
    assert standing and set(chosen) <= scene.casts
    for number in standing:
        both = scene.with_stand(number)
        assert both[scene.mask(number)].all() and both[scene.mask(scene.stands_on[number])].all()
        assert not (scene.mask(number) & scene.mask(scene.stands_on[number])).any()
