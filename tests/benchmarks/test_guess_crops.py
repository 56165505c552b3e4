"""Crops that the judge of guesses learns from, and the sensors that saw them."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.rendering import render
from dlama.geometry.scene import Scene
from dlama.geometry.trajectories import orbit
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.training.data.samples.guesses import SIDE
from guess_crops import FillTask, crops_of
from sensors import add_photo_noise, stereo_matcher, structured_light
from worlds import Box, Plane, Sphere, World

WORLD = World((Plane((0, 1, 0), (0, 1, 0)), Box((-9, -0.5, 6), (9, 1, 7)), Sphere((0, 0.3, 3), 0.4)))


def test_a_crop_of_a_view_has_its_guesses_and_the_truth():
    """Law: every guess shows the view where it is known; the truth's known pixels are the view's, its holes the true frame's."""
    camera = Camera.from_fov(SIDE, SIDE, 70)
    frame, target = WORLD.rgbd(camera), WORLD.rgbd(orbit(camera, 12))
    view = render(frame, target.camera)
    asked = FillTask(view, FillContext.of(Scene((View.from_rgbd(frame),))), target)
    crop = next(crops_of(asked, np.random.default_rng(0)))
    known = crop.context[-2] == 0
    for color in (*crop.color, crop.true_color):
        np.testing.assert_array_equal(color[:, known], view.color.transpose(2, 0, 1)[:, known])
    np.testing.assert_array_equal(crop.true_color[:, ~known], target.color.transpose(2, 0, 1)[:, ~known])
    assert (crop.depth[0][~known] == 0).all() and crop.true_known.all()
    for depth in crop.depth[1:]:
        np.testing.assert_array_equal(depth[known], crop.depth[0][known])


@pytest.mark.parametrize("sensor", [structured_light, stereo_matcher])
def test_sensors_measure_what_is_there(sensor):
    """Law: colours stay, most depths are within a tenth of the truth, something is missing or changed; the same bits again."""
    frame = WORLD.rgbd(Camera.from_fov(96, 72, 70))
    one, other = (sensor(frame, np.random.default_rng(4)) for _ in range(2))
    np.testing.assert_array_equal(one.depth, other.depth)
    np.testing.assert_array_equal(one.color, frame.color)
    both = one.valid & frame.valid
    assert both.mean() > 0.3 and (one.depth != frame.depth).any()
    assert np.median(np.abs(one.depth[both] / frame.depth[both] - 1)) < 0.1


def test_a_photographed_picture_is_nearly_the_same():
    """Closed form: grey stays grey within the noise."""
    grey = np.full((64, 64, 3), 128, np.uint8)
    assert abs(add_photo_noise(grey, np.random.default_rng(1)).astype(int) - 128).mean() < 8
