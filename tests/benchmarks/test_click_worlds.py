"""Worlds whose objects stand on objects, against the plain worlds of the same seeds."""

from __future__ import annotations

import numpy as np

from click_worlds import NEAR_M, ClickWorld, near_camera, objects_in_sight
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


def test_crowded_worlds_have_more_objects() -> None:
    """Laws: there are more of them, and those on tables are noted."""
    plain, made = ClickWorld(78), ClickWorld(78, crowded=True)
    assert len(made.stands_on) > len(plain.stands_on)
    assert set(made.stands_on) <= set(made.groups.tolist())
    assert len(made.casts) > len(plain.casts)


def test_a_near_camera_looks_at_an_object() -> None:
    """Laws: it is upright, and along its axis nothing is seen beyond the largest distance from the object."""
    made = ClickWorld(78, stands=True)
    scene = made.scene(made.world.camera(10, 128, 75))
    for seed in range(8):
        camera = near_camera(scene, np.random.default_rng(seed))
        assert camera is not None and camera.world_from_cam[1, 0] == 0 and camera.world_from_cam[1, 1] > 0
        middle = made.scene(camera).frame.depth[62:67, 62:67]
        assert middle.min() < NEAR_M[1]
