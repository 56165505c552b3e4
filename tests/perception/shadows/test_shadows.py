"""Shadows against closed forms: a box on a plain ground, its shadow thrown by hand; and none where there is none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import dlama
from dlama import find_mask
from dlama.geometry.camera import Camera
from dlama.geometry.holes import erode_mask, iou
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.shadows.find import enclosed_between, find_shadow, grow_under_object
from marks import first_quick
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(240, 180, 70)
BOX = Box((-0.3, 0.1, 2.6), (0.2, 1.0, 3.0))
WORLD = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 8), (0, 0, -1)), BOX))
TO_LIGHT = np.array([-1.0, -1.2, 0.3])
"""From a point to the light: the shadow lies to the right of the box."""


@cache
def lit_and_shadow(darker: float) -> tuple[RGBD, BoolArray, BoolArray]:
    """The scene with a noisy grey ground, the box's mask and the pixels of the ground from which the box hides the light."""
    rgbd, shown = WORLD.rgbd(CAMERA), WORLD.trace(CAMERA)[1]
    points = rays(CAMERA) * rgbd.depth[..., None]
    shadow = (shown == 0) & np.isfinite(BOX.hit(points, np.broadcast_to(TO_LIGHT, points.shape)))
    rng = np.random.default_rng(0)
    level = np.where(shown == 2, 90.0, 150.0) * np.where(shadow, darker, 1) + rng.normal(0, 4, shown.shape)
    color = np.repeat(np.clip(level, 0, 255).astype(np.uint8)[..., None], 3, 2)
    return RGBD(color, rgbd.depth, CAMERA), shown == 2, shadow


@pytest.mark.parametrize("darker", first_quick([0.45, 0.7]))
def test_a_cast_shadow_is_found(darker: float) -> None:
    rgbd, mask, shadow = lit_and_shadow(darker)
    found = find_shadow(rgbd, mask)
    assert not (found & mask).any()
    assert (found & shadow).sum() > 0.75 * shadow.sum()
    assert (found & shadow).sum() > 0.75 * found.sum()


def test_where_there_is_no_shadow_none_is_found() -> None:
    rgbd, mask, _ = lit_and_shadow(1.0)
    assert not find_shadow(rgbd, mask).any()


def test_a_click_with_its_shadow() -> None:
    """find_mask adds it to the mask and says which part it is."""
    rgbd, mask, shadow = lit_and_shadow(0.5)
    rows, columns = np.nonzero(mask)
    found = find_mask(rgbd, clicks=[(float(np.median(columns)), float(np.median(rows)))], with_shadow=True)
    assert found.shadow is not None
    assert (found.shadow & ~found.mask).sum() == 0
    assert (found.mask & shadow).sum() > 0.75 * shadow.sum()


def test_a_pattern_is_no_shadow() -> None:
    """Dark stripes all over the ground, one of which touches the box: what is everywhere is no shadow."""
    rgbd, mask, _ = lit_and_shadow(1.0)
    points = rays(CAMERA) * rgbd.depth[..., None]
    stripe = (np.floor(points[..., 0] / 0.35).astype(int) % 2 == 0) & ~mask & (rgbd.depth < 7.9)
    color = np.where(stripe[..., None], rgbd.color * 0.6, rgbd.color).astype(np.uint8)
    assert not find_shadow(RGBD(color, rgbd.depth, CAMERA), mask).any()


@pytest.mark.parametrize(("tone", "right"), first_quick([(0.65, (-1.6, 0.0)), (0.75, (-0.2, 2.0))]))
def test_a_rug_that_the_shadow_touches_is_no_part_of_it(tone: float, right: tuple[float, float]) -> None:
    """A rug as dark as the shadow begins next to the box or under it: of what is there the shadow alone is found."""
    rgbd, mask, shadow = lit_and_shadow(0.5)
    points = rays(CAMERA) * rgbd.depth[..., None]
    rug = (points[..., 0] > right[0]) & (points[..., 0] < right[1]) & (points[..., 2] > 2.1) & (points[..., 2] < 4)
    rug &= ~mask & (np.abs(points[..., 1] - 1) < 0.01)
    color = np.where(rug[..., None], rgbd.color * tone, rgbd.color).astype(np.uint8)
    found = find_shadow(RGBD(color, rgbd.depth, CAMERA), mask)
    assert (found & shadow).sum() > 0.75 * shadow.sum()
    assert (found & rug & ~shadow).sum() < 0.2 * (rug & ~shadow).sum()


def test_a_shadow_in_estimated_depth() -> None:
    """The box leans against a bent ground, as networks say it; it is taken to stand upright where its foot is."""
    rgbd, mask, shadow = lit_and_shadow(0.5)
    v, u = np.mgrid[: mask.shape[0], : mask.shape[1]]
    w = 1 / rgbd.depth * (1 + 0.04 * np.sin(u / 40) * np.cos(v / 30))
    w = np.where(mask, w + 0.3 * (1 / WORLD.rgbd(CAMERA).depth - w), w)
    bent = RGBD(rgbd.color, (1 / w).astype(np.float32), CAMERA, {"estimator": "none"})
    found = find_shadow(bent, mask)
    assert (found & shadow).sum() > 0.6 * shadow.sum()
    assert (found & shadow).sum() > 0.75 * found.sum()


@pytest.mark.slow
def test_a_shadow_in_matched_depth() -> None:
    """Oracle: the shadow in exact depth. The noise of matching cut the ground into pieces, and none was found."""
    street = dlama.example()
    exact = dlama.read_rgbd(street / "street.jpg", street / "depth.png", fov=90)
    mask = dlama.find_mask(exact, clicks=[(256, 345)]).mask
    rig = dlama.read_stereo_calib(street / "calib.txt")
    pair = dlama.stereo(exact.color, dlama.read_color(street / "right.jpg"), rig, filler="telea")
    matched = dlama.RGBD(exact.color, pair.views[0].depth, rig.left)
    assert iou(find_shadow(matched, mask), find_shadow(exact, mask)) > 0.7


def test_another_object_in_the_shadow_is_never_covered() -> None:
    """Law: only the surface is covered. A second box stands where the first one's shadow falls, as dark as that; where it meets
    the ground, which is both, a pixel is allowed."""
    rgbd, mask, shadow = lit_and_shadow(0.5)
    world = World((*WORLD.shapes, Box((0.5, 0.6, 2.4), (0.8, 1.0, 2.7))))
    shown = world.trace(CAMERA)[1]
    color = np.where((shown == 3)[..., None], np.uint8(70), rgbd.color)
    found = find_shadow(RGBD(color, world.rgbd(CAMERA).depth, CAMERA), mask)
    assert found.any() and (shown == 3).sum() > 100
    assert not (found & erode_mask(shown != 0, 1)).any()
    assert (found & shadow & (shown == 0)).sum() > 0.75 * found.sum()


def test_a_side_that_the_mask_lacks_comes_with_the_shadow() -> None:
    """What the object and its shadow enclose is removed with them; what is surface there, or enclosed by the object alone,
    is not."""
    mask, shadow, surface = np.zeros((3, 40, 40), np.bool_)
    mask[5:20, 5:30] = True
    mask[8:12, 8:12] = False  # seen through the object
    shadow[20:30, 5:30] = True
    shadow[20:24, 8:16] = False  # the side
    shadow[24:28, 20:26] = False  # a bright spot of the surface
    surface[20:] = True
    surface[20:24, 8:16] = False
    side = np.zeros_like(mask)
    side[20:24, 8:16] = True
    np.testing.assert_array_equal(enclosed_between(mask, shadow, surface), side)


def test_what_is_black_right_under_an_object_is_its_shadow() -> None:
    """The black band under it, as under a car, comes with a grey shadow next to it; a black stripe of the ground farther off, and
    one next to the object, do not."""
    rgbd, _, _ = lit_and_shadow(1.0)
    mask, shadow, band, stripes, usable = np.zeros((5, *rgbd.depth.shape), np.bool_)
    mask[40:100, 60:160] = True
    band[100:108, 60:160] = True
    shadow[108:116, 60:160] = True
    stripes[140:144, 60:160] = True
    stripes[60:100, 170:180] = True
    usable[40:] = True
    level = np.where(band | stripes, 10, np.where(shadow, 80, 150)).astype(np.uint8)
    grown = grow_under_object(replace(rgbd, color=np.repeat(level[..., None], 3, 2)), mask, usable & ~mask, shadow)
    assert (grown & band).sum() > 0.9 * band.sum()
    assert not (grown & ~band & ~shadow).any()
