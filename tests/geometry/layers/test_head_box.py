"""The head box (oracles: parallax by its closed form, where points land, the definition of the grid)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.layers.head_box import PARALLAX, TOWARDS, WIDEST, HeadBox, way_to_back
from dlama.geometry.projection import lift, project
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View

CAMERA = Camera.from_fov(120, 80, 60)


def slope() -> View:
    """Depth that is affine in inverse depth: 2 m at the left, 6 m at the right, through a narrow lens."""
    w = np.linspace(1 / 2, 1 / 6, 120, dtype=np.float32)
    return View.from_rgbd(RGBD(np.zeros((80, 120, 3), np.uint8), np.tile(1 / w, (80, 1)), Camera.from_fov(120, 80, 15)))


def test_the_median_parallax_is_4_percent() -> None:
    """Points seen from both ends of the box are apart by 4 % of the width in the median (to what the turn adds)."""
    box = HeadBox.of(slope())
    points = lift(slope()).points
    left, right = (project(points, box.at(side, 0, 0))[0] for side in (-1, 1))
    assert np.median(np.abs(left - right)[:, 0]) == pytest.approx(PARALLAX * 120, rel=0.05)
    assert box.pivot == pytest.approx(3, rel=0.02)


def floor(height: float) -> View:
    """A floor so many metres under the camera, out to 4 m, and a wall there."""
    rays = (np.arange(80) + 0.5 - CAMERA.cy) / CAMERA.fy
    depth = np.minimum(height / np.maximum(rays, 1e-6), 4)[:, None] * np.ones(120)
    return View.from_rgbd(RGBD(np.zeros((80, 120, 3), np.uint8), depth.astype(np.float32), CAMERA))


@pytest.mark.parametrize("height", [0.2, 0.5])
def test_the_default_box_stays_above_the_floor(height: float) -> None:
    """A floor is seen from behind as soon as a camera is below it; a wall never is."""
    view = floor(height)
    assert way_to_back(view) == pytest.approx(height, rel=0.02)
    assert way_to_back(floor(100)) == np.inf
    box = HeadBox.of(view)
    lowest = max(camera.world_from_cam[1, 3] for camera in box.grid())
    assert lowest <= TOWARDS * height * 1.1
    assert HeadBox.of(floor(100)).angle >= box.angle


def test_every_camera_looks_at_the_pivot() -> None:
    """The pivot is in the middle of all pictures, and all but the source's are in the grid."""
    box = HeadBox(CAMERA, 3.0, 10.0, 0.1)
    pivot = CAMERA.world_from_cam[:3, 3] + 3 * CAMERA.world_from_cam[:3, 2]
    for camera in (*box.grid(), *box.sample(5)):
        assert project(pivot[None], camera)[0][0] == pytest.approx((60, 40))
    assert len(box.grid()) == 26 and len(HeadBox(CAMERA, 3.0, 10.0, 0.0).grid()) == 8
    assert HeadBox(CAMERA, 3.0, 0.0, 0.0).grid() == []
    assert box.at(0, 0, 0).same_view_as(CAMERA)


def test_the_wide_camera_holds_what_the_others_see() -> None:
    """Corners of all pictures at the pivot's distance lie in it."""
    box = HeadBox(CAMERA, 3.0, 4.0, 0.05)
    wide = box.wide()
    corners = np.array([[x, y, 1.0] for x in (0, 120) for y in (0, 80)]) @ np.linalg.inv(CAMERA.K).T
    for camera in box.grid():
        points = 3 * corners @ camera.world_from_cam[:3, :3].T + camera.world_from_cam[:3, 3]
        pixels, _ = project(points, wide)
        assert (pixels >= -1e-6).all() and (pixels <= np.array(wide.wh) + 1e-6).all()


@pytest.mark.parametrize("fov", [150, 179])
def test_a_wide_lens_has_a_wide_camera_of_bounded_size(fov: float) -> None:
    """Corners that other cameras of the box see lie behind the middle one: its picture is as large as it may be, no more."""
    box = HeadBox(Camera.from_fov(120, 80, fov), 3.0, 12.0, 0.2)
    assert box.wide().wh == (120 + 2 * int(WIDEST * 120), 80 + 2 * int(WIDEST * 80))
