"""Simulated sensors: what they change of an exact frame, and what they leave."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from sensors import add_photo_noise, stereo_matcher, structured_light, time_of_flight
from worlds import Box, Plane, Sphere, World

WORLD = World((Plane((0, 1, 0), (0, 1, 0)), Box((-9, -0.5, 6), (9, 1, 7)), Sphere((0, 0.3, 3), 0.4)))


@pytest.mark.parametrize("sensor", [structured_light, stereo_matcher, time_of_flight])
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
