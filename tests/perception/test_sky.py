"""Sky without depth, and matches of it and at infinity (oracles: closed forms; the truth of generated streets; laws)."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.perception.sky import drop_plain_infinity, find_plain_sky
from dlama.worlds.dataset import world
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(192, 144, 70)
HOUSE = World(
    (Plane((0, 1.5, 0), (0, -1, 0)), Box((-9.0, -1.0, 9.0), (2.0, 1.5, 11.0)), Box((2.5, -9.0, 8.0), (4.0, 1.5, 9.0)))
)
"""A street, a house whose roof the picture shows, and a tower that divides the sky."""
BLUE, WHITE = (120, 160, 215), (246, 246, 244)
HW = 120, 160


def street(color: tuple[int, int, int], farthest: float = np.inf) -> tuple[RGBD, BoolArray]:
    """The house before a sky of that colour, without depth there, and where that is. farthest: metres, where depth ends."""
    true = HOUSE.rgbd(CAMERA)
    far = np.isposinf(true.depth)
    shown = np.where(far[..., None], np.uint8(color), np.uint8(true.color // 2)).astype(np.uint8)
    depth = np.where(far, np.float32(0), np.minimum(true.depth, np.float32(farthest)))
    return RGBD(shown, depth, CAMERA, padding=np.zeros(far.shape, np.bool_)), far


def sky_of(rgbd: RGBD) -> BoolArray:
    """What is found where depth is missing."""
    return find_plain_sky(rgbd.color, rgbd.depth == 0, rgbd.depth)


@pytest.mark.parametrize("color", [BLUE, WHITE])
def test_sky_without_depth_is_far(color: tuple[int, int, int]) -> None:
    """Truth: sky of one colour is far to its rim, on both sides of a tower; what was measured keeps its bits."""
    rgbd, far = street(color)
    done = dlama.complete(rgbd, [CAMERA], filler="layered").view
    assert far.mean() > 0.2 and np.isposinf(done.depth[far]).mean() > 0.99
    np.testing.assert_array_equal(done.depth[~far], rgbd.depth[~far])


def test_readings_of_a_lidar_keep_the_house() -> None:
    """Truth: of depth in one pixel of twenty the sky is far, the house and the street are where they are."""
    rgbd, far = street(BLUE)
    depth = rgbd.depth * (np.random.default_rng(0).random(far.shape) < 0.05)
    done = dlama.complete(RGBD(rgbd.color, depth, CAMERA, padding=rgbd.padding), [CAMERA], filler="layered").view
    near = ~far & (rgbd.depth < 20)
    assert np.isposinf(done.depth[far]).mean() > 0.95
    assert (np.abs(done.depth[near] / rgbd.depth[near] - 1) < 0.05).mean() > 0.95


def test_a_cloud_is_sky() -> None:
    """Truth: a bright cloud amid the sky, which is no part of its plain, is far as well."""
    rgbd, far = street(BLUE)
    cloud = np.zeros(far.shape, np.uint8)
    cv2.circle(cloud, (60, 18), 9, 1, -1)
    color: UInt8Array = np.where((cloud > 0)[..., None] & far[..., None], np.uint8(WHITE), rgbd.color)
    cloudy = RGBD(color, rgbd.depth, CAMERA, padding=rgbd.padding)
    done = dlama.complete(cloudy, [CAMERA], filler="layered").view
    assert not sky_of(cloudy)[cloud > 0].all() and np.isposinf(done.depth[cloud > 0]).all()


@pytest.mark.parametrize(
    ("color", "farthest"),
    [((150, 120, 90), np.inf), ((60, 60, 60), np.inf), (WHITE, 5.0)],
    ids=["warm", "dark", "room"],
)
def test_no_sky(color: tuple[int, int, int], farthest: float) -> None:
    """Law: a wooden or a dark ceiling is no sky, nor a white one where all that was measured is near."""
    assert not sky_of(street(color, farthest)[0]).any()


def test_a_patterned_ceiling_is_no_sky() -> None:
    """Law: what is bright but not plain stays a surface."""
    rgbd, far = street(WHITE)
    pattern = np.uint8(40) * (np.indices(far.shape).sum(0) // 3 % 2).astype(np.uint8)
    color = np.where(far[..., None], rgbd.color - pattern[..., None], rgbd.color)
    assert not sky_of(RGBD(color, rgbd.depth, CAMERA, padding=rgbd.padding)).any()


def test_a_ceiling_that_was_measured_in_part_is_no_sky() -> None:
    """Law: of a plain white ceiling over a hall stripes were measured; what lacks depth between them is ceiling, too."""
    rgbd, far = street(WHITE)
    measured = far & (np.arange(CAMERA.width) % 40 < 16)
    depth = np.where(measured, np.float32(7), rgbd.depth)
    assert sky_of(rgbd).any()
    assert not sky_of(RGBD(rgbd.color, depth, CAMERA, padding=rgbd.padding)).any()


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
