"""Faults of a sensor, other light, mirrored pairs: each against what it says of itself."""

from __future__ import annotations

import numpy as np
from toy_runs import world_source

from dlama.geometry.camera import Camera
from dlama.geometry.drawing.grid_mesh import find_joints
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.training.data import augment
from dlama.training.settings import NetworkSettings

CAMERA = Camera.from_fov(96, 72, 70)


def frame() -> RGBD:
    """A box before a slanted wall, sky above, one pixel missing."""
    depth = np.linspace(2, 5, 96, dtype=np.float32)[None].repeat(72, 0)
    depth[30:60, 30:60], depth[:10], depth[70, 5] = 1.0, np.inf, 0
    return RGBD(np.full((72, 96, 3), 90, np.uint8), depth, CAMERA)


def test_noise_is_relative_and_leaves_sky_and_gaps() -> None:
    """Standard deviation of the relative change of inverse depth lies in the stated range; far and missing stay."""
    depth = frame().depth
    for seed in range(20):
        noisy = augment.add_depth_noise(depth, np.random.default_rng(seed))
        valid = frame().valid
        spread = (depth[valid] / noisy[valid]).std()
        assert augment.NOISE[0] * 0.7 < spread < augment.NOISE[1] * 1.3
        assert np.array_equal(np.isinf(noisy), np.isinf(depth)) and np.array_equal(noisy == 0, depth == 0)


def test_quantised_to_equal_steps() -> None:
    """No more steps than stated, all a whole number of the smallest; the error is half a step at most."""
    depth, valid = frame().depth, frame().valid
    for seed in range(10):
        made = augment.quantise_depth(depth, np.random.default_rng(seed))
        w = np.unique((1 / made[valid].astype(np.float64)).round(9))
        assert 2 < len(w) <= augment.LEVELS[1]
        step = np.abs(1 / made[valid].astype(np.float64) - 1 / depth[valid]).max() * 2
        assert step <= 1.01 / augment.LEVELS[0]
        assert np.array_equal(made == 0, depth == 0)


def test_flying_pixels_fly() -> None:
    """Depth stays between its neighbours', changes at edges only, and rendering's own detector finds some of them."""
    clean = frame()
    made = augment.add_flying_pixels(clean.depth, np.random.default_rng(0))
    changed = np.argwhere(made != clean.depth)
    assert 10 < len(changed) < 300
    for row, column in changed:
        near = clean.depth[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        assert near[near > 0].min() <= made[row, column] <= near[np.isfinite(near)].max()
    assert find_joints(View.from_rgbd(RGBD(clean.color, made, CAMERA))).flying.sum() > 5


def test_sensor_holes_only_take_away() -> None:
    """Pixels are as they were or 0; the picture is not emptied."""
    for seed in range(20):
        made = augment.add_depth_holes(frame().depth, np.random.default_rng(seed))
        gone = made != frame().depth
        assert (made[gone] == 0).all() and 0 < gone.mean() < 0.5


def test_faults_from_one_state_are_the_same() -> None:
    """With sensor holes asked for there are always some."""
    for seed in range(8):
        one, same = (
            augment.add_depth_faults(frame(), np.random.default_rng(seed), sensor_holes=True) for _ in range(2)
        )
        assert np.array_equal(one.depth, same.depth) and one.missing.sum() > 1


def sample(planes: str) -> dict[str, np.ndarray]:
    """A frame or a pair of a world with an object removed."""
    return world_source(NetworkSettings(planes), 64).sample(3, np.random.default_rng(0))


def test_mirrored_pairs_stay_pairs() -> None:
    """In a mirrored pair the mirrored right picture is the left one, so disparities keep their sign; twice is nothing."""
    for planes, masks in (("stereo", 1), ("stereo-two-masks", 2)):
        made = sample(planes)
        seed = next(seed for seed in range(9) if np.random.default_rng(seed).random() >= 0.5)
        flipped = augment.mirror_at_random(made, np.random.default_rng(seed), 2)
        assert np.array_equal(flipped["target"][:3], made["target"][3:, :, ::-1])
        assert np.array_equal(flipped["target"][3:], made["target"][:3, :, ::-1])
        assert np.array_equal(flipped["mask"][0], made["mask"][masks - 1, :, ::-1])
        assert np.array_equal(flipped["input"][6:], flipped["mask"])
        again = augment.mirror_at_random(flipped, np.random.default_rng(seed), 2)
        assert all(np.array_equal(again[key], made[key]) for key in made)


def test_mirrored_views_or_not() -> None:
    """Half of the samples are mirrored, in all planes at once."""
    made, count = sample("rgbd"), 0
    for seed in range(60):
        flipped = augment.mirror_at_random(made, np.random.default_rng(seed), 1)
        is_flipped = not np.array_equal(flipped["target"], made["target"])
        count += is_flipped
        assert all(np.array_equal(flipped[key], made[key][..., ::-1] if is_flipped else made[key]) for key in made)
    assert 15 < count < 45


def test_light_is_one_curve_for_input_and_target() -> None:
    """The hole stays 0, depth stays, known pixels of input and target stay equal, and a rising curve keeps the order."""
    made = sample("rgbd")
    lit = augment.change_light(made, np.random.default_rng(4), 3)
    known = made["mask"][0] == 0
    assert np.array_equal(lit["target"][:3, known], lit["input"][:3, known])
    assert (lit["input"][:3, ~known] == 0).all() and np.array_equal(lit["target"][3], made["target"][3])
    assert np.abs(lit["target"][:3] - made["target"][:3]).max() > 0.01
    for channel in range(3):
        order = np.argsort(made["target"][channel].ravel(), kind="stable")
        assert (np.diff(lit["target"][channel].ravel()[order]) >= -1e-6).all()
    assert lit["target"].min() >= 0 and lit["target"].max() <= 1
