"""The sky's colours by height (oracles: closed forms, skies that are linear in the sine of the elevation)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.inpainters.sky import OUTERMOST, RIDGE, Sky, directions
from worlds import moved

CAMERA = Camera.from_fov(64, 48, 60)
UP = np.array([0, -1, 0])


def height(camera: Camera) -> np.ndarray:
    """H x W sines of the elevation, by hand."""
    rows, columns = np.indices(camera.hw)
    x, y = (columns + 0.5 - camera.cx) / camera.fx, (rows + 0.5 - camera.cy) / camera.fy
    rays = np.stack([x, y, np.ones_like(x)], -1) @ camera.world_from_cam[:3, :3].T
    return rays @ UP / np.linalg.norm(rays, axis=-1)


def painted(camera: Camera) -> np.ndarray:
    """H x W x 3 uint8: darker and bluer the higher."""
    return np.round(200 - height(camera)[..., None] * (100, 80, 40)).astype(np.uint8)


def test_directions_are_those_of_pixel_centres() -> None:
    """Closed form: unit vectors; straight ahead through the principal point, whatever way the camera is turned."""
    turned = moved(CAMERA, turn=(10, 25, 0))
    through = directions(turned, np.array(CAMERA.cx), np.array(CAMERA.cy))
    np.testing.assert_allclose(through, turned.world_from_cam[:3, 2], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(directions(turned, np.arange(64.0), np.array(3.5)), axis=-1), 1)


@pytest.mark.parametrize("yaw", [0, 30])
def test_a_gradient_goes_on_where_another_camera_looks(yaw: float) -> None:
    """Truth: of a sky linear in height, less what RIDGE takes of its slope; seen by a camera that is turned, and by cells."""
    far = height(CAMERA) > 0
    sky = Sky.of([(CAMERA, painted(CAMERA), far)])
    other = moved(CAMERA, turn=(0, yaw, 0))
    assert sky is not None
    kept = height(CAMERA)[far].var() / (height(CAMERA)[far].var() + RIDGE)
    np.testing.assert_allclose(sky.slope, kept * np.array((-100, -80, -40)), rtol=0.02)
    inside = (height(other) > 0.05) & (height(other) < 0.3)
    wanted = sky.mean + (height(other) - sky.height)[..., None] * sky.slope
    np.testing.assert_allclose(sky.render_sky(other)[inside], wanted[inside], atol=0.5)
    assert sky.render_sky(other, 5).shape == (10, 13, 3)
    np.testing.assert_allclose(sky.render_sky(other, 5)[2, 6], sky.render_sky(other)[12, 32], atol=1e-4)


def test_no_colour_is_painted_that_was_not_seen() -> None:
    """Law: below the horizon and far above what was seen colours end at those of the outermost OUTERMOST."""
    far = (height(CAMERA) > 0.1) & (height(CAMERA) < 0.3)
    sky = Sky.of([(CAMERA, painted(CAMERA), far)])
    assert sky is not None
    seen = sky.render_sky(moved(CAMERA, turn=(-40, 0, 0)))
    least, most = np.quantile(painted(CAMERA)[far], (OUTERMOST, 1 - OUTERMOST), axis=0)
    assert (seen >= least - 0.01).all() and (seen <= most + 0.01).all()


def test_without_far_pixels_there_is_no_sky() -> None:
    """Definition; and a frame without any does not count."""
    none = CAMERA, painted(CAMERA), np.zeros(CAMERA.hw, bool)
    far = CAMERA, painted(CAMERA), height(CAMERA) > 0
    assert Sky.of([]) is None and Sky.of([none]) is None
    np.testing.assert_array_equal(Sky.of([none, far]).mean, Sky.of([far]).mean)
