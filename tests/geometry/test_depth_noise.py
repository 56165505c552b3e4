"""The noise of depth (oracle: the noise that was added to closed-form worlds)."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.depth_noise import measured_noise
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from marks import first_quick
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(320, 240, 60)
ROOM = World((Plane((0, 1.2, 0), (0, -1, 0)), Plane((0, 0, 6), (0.3, 0, -1)), Box((-0.6, -0.4, 2), (0.2, 0.5, 2.6))))


def noisy(seed: int, *, inverse: float = 0.0, metres: float = 0.0, share: float = 0.0) -> View:
    """A room with steps, with noise of those standard deviations in inverse depth (1/m), in depth, and as a share of it."""
    rng, frame = np.random.default_rng(seed), ROOM.rgbd(CAMERA)
    depth = 1 / (1 / frame.depth.astype(float) + rng.normal(0, inverse, frame.depth.shape))
    depth *= 1 + rng.normal(0, share, depth.shape)
    return View.from_rgbd(
        dataclasses.replace(frame, depth=(depth + rng.normal(0, metres, depth.shape)).astype(np.float32))
    )


@pytest.mark.parametrize("inverse", [2e-4, 2e-3])
@pytest.mark.parametrize("seed", first_quick(range(4)))
def test_noise_that_was_added_is_found(seed: int, inverse: float) -> None:
    """Within 15 %, at steps between surfaces, too."""
    found = measured_noise(noisy(seed, inverse=inverse))
    assert found.constant == pytest.approx(inverse, rel=0.15) and found.share == 0


@pytest.mark.parametrize("share", [0.002, 0.02])
@pytest.mark.parametrize("seed", first_quick(range(4)))
def test_noise_that_is_a_share_of_the_distance_is_found(seed: int, share: float) -> None:
    """Within 15 %, and known from noise that is the same everywhere in inverse depth."""
    assert measured_noise(noisy(seed, share=share)).share == pytest.approx(share, rel=0.15)


def test_exact_depth_has_none() -> None:
    """Planes are straight in inverse depth, to what float32 holds; its median is found."""
    view = noisy(0)
    noise = measured_noise(view)
    assert noise.constant < 1e-7 and noise.share < 1e-6
    assert noise.middle == pytest.approx(float(np.median(1 / view.depth)), rel=0.1)


def test_noise_of_metres_counts_as_it_is_far_away() -> None:
    """Oracle: an error of depth z by 4 mm is one of 4 mm / z^2 in inverse depth, at most as in the farther half."""
    view = noisy(0, metres=0.004)
    nearest_of_far = float(np.median(view.depth))
    assert measured_noise(view).constant < 1.15 * 0.004 / nearest_of_far**2


def test_only_what_is_measured_counts() -> None:
    """Filled depth is smoother than measured depth, and of a few pixels nothing is said."""
    view = noisy(0, inverse=2e-3)
    filled = np.arange(240)[:, None] % 80 >= 20
    depth = np.where(filled, ROOM.rgbd(CAMERA).depth, view.depth)
    origin = np.where(filled, np.uint8(Origin.DEPTH_FILLED), view.origin)
    mixed = dataclasses.replace(view, depth=depth, origin=origin)
    assert measured_noise(mixed).constant == pytest.approx(2e-3, rel=0.15)
    keep = np.zeros(view.hole.shape, bool)
    keep[:20, :20] = True
    assert measured_noise(view.without(~keep, HoleType.SENSOR)) == (0.0, 0.0, 0.0)


def test_noise_of_a_larger_picture_is_as_smooth() -> None:
    """Oracle: the same picture and depth at eight times the size, where neighbours hardly differ."""
    view = noisy(0, inverse=2e-3)
    large = cv2.resize(view.depth, None, fx=8, fy=8, interpolation=cv2.INTER_CUBIC)
    color = np.zeros((*large.shape, 3), np.uint8)
    enlarged = View.from_rgbd(RGBD(color, large, Camera.from_fov(*large.shape[::-1], 60)))
    assert measured_noise(enlarged).constant == pytest.approx(2e-3, rel=0.3)  # between pixels, noise is interpolated
