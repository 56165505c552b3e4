"""Matches at infinity, and of the sky (oracles: closed forms; the truth of a procedural street)."""

from __future__ import annotations

import numpy as np
import pytest

import dlama
from dlama.geometry.rgbd import UInt8Array
from dlama.perception.stereo.infinity import drop_plain_infinity
from dlama.worlds.dataset import world

HW = 120, 160


def noise(seed: int = 0) -> UInt8Array:
    """A picture with texture everywhere."""
    blocks = np.random.default_rng(seed).integers(0, 255, (30, 40, 1), np.uint8)
    return np.repeat(np.repeat(blocks, 4, 0), 4, 1).repeat(3, 2)


def test_infinity_must_be_seen_in_texture() -> None:
    """Closed form: of a picture at infinity, the part whose colours change from row to row alone is unknown; finite matches
    stay, however plain."""
    color, disparity = noise(), np.full(HW, 1e-6, np.float32)
    color[40:80, 40:120] = (np.arange(40) % 8 * 20 + 40).astype(np.uint8)[:, None, None]
    got = drop_plain_infinity(color, disparity, np.full(HW, np.inf, np.float32))
    assert not got[52:68, 52:108].any()
    away = np.ones(HW, np.bool_)
    away[28:92, 28:132] = False
    assert (got[away] > 0).mean() > 0.95
    near = drop_plain_infinity(color, disparity, np.full(HW, 4, np.float32))
    np.testing.assert_array_equal(near, disparity)


def test_a_match_of_the_sky_is_none() -> None:
    """Closed form: sky with the disparity of the roof next to it is unknown; what has texture keeps its disparity."""
    color, disparity, depth = noise(), np.full(HW, 3, np.float32), np.full(HW, 9, np.float32)
    color[:40] = (120, 160, 215)
    got = drop_plain_infinity(color, disparity, depth)
    assert not got[:38].any()
    np.testing.assert_array_equal(got[44:], disparity[44:])


@pytest.mark.parametrize("seed", [322, 329])
def test_the_sky_of_noisy_pictures_is_far(seed: int) -> None:
    """Truth of a street: with noise of its own in each picture, nearly all of the sky is far, and next to nothing else."""
    street, rng = world(seed), np.random.default_rng(seed)
    rig = street.rig(256)
    frames = [street.frame(camera) for camera in (rig.left, rig.right)]
    left, right = (
        np.clip(np.rint(one.color + rng.normal(0, 2.5, one.color.shape)), 0, 255).astype(np.uint8) for one in frames
    )
    far, found = (
        np.isposinf(frames[0].depth),
        np.isposinf(dlama.stereo(left, right, rig, filler="layered").views[0].depth),
    )
    assert far.mean() > 0.1 and found[far].mean() > 0.8 and (found & ~far).mean() < 0.01
