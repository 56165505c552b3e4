"""How much of the sky an object hides against closed forms, and the lit surface of an overcast day against a made one."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.masks.supports import find_planes_of_picture
from dlama.perception.shadows.find import grow_ambient_shadow
from dlama.perception.shadows.ground import (
    Ground,
    crop_around,
    find_ground,
    measure_object,
    object_points,
)
from dlama.perception.shadows.lit_surface import ambient_occlusion, measure_darkness
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(320, 240, 90)
GROUND, BACK = Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 9), (0, 0, -1))


def seen(item: Box) -> tuple[RGBD, BoolArray, Ground, np.ndarray]:
    """The frame, the object's mask, the ground, and the points seen."""
    world = World((GROUND, BACK, item))
    rgbd, shown = world.rgbd(CAMERA), world.trace(CAMERA)[1]
    mask = shown == 2
    ground = find_ground(rgbd, mask, find_planes_of_picture(rgbd))
    assert ground is not None
    return rgbd, mask, ground, rays(CAMERA) * rgbd.depth[..., None]


def hidden_from(rgbd: RGBD, mask: BoolArray, ground: Ground) -> np.ndarray:
    """H x W: how much of the sky the object under the mask hides."""
    item = measure_object(*object_points(rgbd, mask, ground), ground)
    return ambient_occlusion(item, rgbd.camera, crop_around(mask))


def test_before_a_wide_wall() -> None:
    """Closed form: at the distance d before the middle of a wide wall of height h, (1 - d / hypot(d, h)) / 2 of the
    light is hidden."""
    rgbd, mask, ground, points = seen(Box((-2.1, 0.1, 2.2), (2.1, 1.0, 2.3)))
    hidden = hidden_from(rgbd, mask, ground)
    apart = 2.2 - points[..., 2]
    middle = ground.surface & (np.abs(points[..., 0]) < 0.3)
    for near in (0.25, 0.4, 0.55):
        some = middle & (apart > near) & (apart < near + 0.1)
        true = (1 - apart[some] / np.hypot(apart[some], 0.9)) / 2
        assert some.sum() > 100
        assert hidden[some].mean() == pytest.approx(true.mean(), abs=0.035)


def test_the_lit_surface_of_an_overcast_day() -> None:
    """A ground of one grey that loses what is hidden of its light: the fit tells how dark it is, though all near it is, too."""
    rgbd, mask, ground, _ = seen(Box((-0.8, 0.2, 2.6), (0.8, 1.0, 3.2)))
    hidden = hidden_from(rgbd, mask, ground)
    level = (
        160 * np.where(ground.surface, (1 - hidden) ** 0.4, 1) - 4 + np.random.default_rng(0).normal(0, 2, mask.shape)
    )
    gray = np.repeat(np.clip(level, 0, 255).astype(np.uint8)[..., None], 3, 2)
    made = RGBD(gray, rgbd.depth, CAMERA)
    reported, blind = (measure_darkness(made, mask, ground.surface, each) for each in (hidden, np.zeros_like(hidden)))
    assert reported is not None and blind is not None and not blind.ambient.any()
    dark = ground.surface & (hidden > 0.2) & (hidden < 0.9)
    true = -0.4 * np.log(1 - hidden[dark])
    assert np.abs(reported.dark[dark] - true).mean() < 0.03 < np.abs(blind.dark[dark] - true).mean()
    assert np.abs(reported.ambient[dark] - true).mean() < 0.03


def test_no_more_light_is_lost_than_there_is() -> None:
    """Law: were all light the sky's, levels fell by the gamma's root of it; a darker foot has other causes."""
    rgbd, mask, ground, _ = seen(Box((-0.8, 0.2, 2.6), (0.8, 1.0, 3.2)))
    hidden = hidden_from(rgbd, mask, ground)
    level = np.repeat((200 * (1 - np.minimum(hidden, 0.95)) ** 1.2).astype(np.uint8)[..., None], 3, 2)
    reported = measure_darkness(RGBD(level, rgbd.depth, CAMERA), mask, ground.surface, hidden)
    assert reported is not None
    assert (
        reported.ambient <= -np.log(1 - np.minimum(hidden, 0.95)) / 2.2 + 1e-6
    ).all() and reported.ambient.max() > 0.3


def test_an_object_that_brightens_keeps_nothing_from_the_surface() -> None:
    """Law: light that the object throws on the ground is no negative shadow."""
    rgbd, mask, ground, _ = seen(Box((-0.8, 0.2, 2.6), (0.8, 1.0, 3.2)))
    hidden = hidden_from(rgbd, mask, ground)
    gray = np.repeat(np.clip(100 * (1 + hidden), 0, 255).astype(np.uint8)[..., None], 3, 2)
    reported = measure_darkness(RGBD(gray, rgbd.depth, CAMERA), mask, ground.surface, hidden)
    assert reported is not None and not reported.ambient.any()


@pytest.mark.parametrize("contrast", [0, 40])
def test_the_rim_of_a_soft_shadow(contrast: int) -> None:
    """The ground loses what is hidden of the sky: of a smooth one all is found that is a tenth darker, from its core on; on tiles
    whose levels differ by several times that nothing is reported."""
    rgbd, mask, ground, _ = seen(Box((-0.8, 0.2, 2.6), (0.8, 1.0, 3.2)))
    hidden = hidden_from(rgbd, mask, ground)
    tiles = contrast * ((np.indices(mask.shape) // 16).sum(0) % 2)
    level = ((150 + tiles) * np.where(ground.surface, (1 - hidden) ** 0.4, 1)).astype(np.uint8)
    made = RGBD(np.repeat(level[..., None], 3, 2), rgbd.depth, CAMERA)
    core, true = ground.surface & (hidden > 0.6), ground.surface & (hidden > 1 - np.exp(-0.1 / 0.4))
    found = grow_ambient_shadow(made, mask, ground, ground.surface, core, hidden)
    assert core.any()
    if contrast:
        assert not found.any()
    else:
        assert (found & true).sum() > 0.85 * max(true.sum(), found.sum())
