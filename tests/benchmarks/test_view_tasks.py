"""What painters learn to fill: views of worlds and photos from another place, with the truth."""

from __future__ import annotations

import numpy as np
import pytest

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rendering import render
from view_tasks import SMALLEST, photo_task, pipeline_tasks
from worlds import Box, Plane, Sphere, World

WORLD = World((Plane((0, 1, 0), (0, 1, 0)), Box((-9, -0.5, 6), (9, 1, 7)), Sphere((0, 0.3, 3), 0.4)))


def test_a_filler_is_asked_for_what_the_other_camera_does_not_see() -> None:
    """Oracle: the frame rendered into that camera; the truth given for it comes with it, that of a third camera does not."""
    camera = Camera.from_fov(96, 80, 70)
    frame, target, third = (WORLD.rgbd(one) for one in (camera, orbit(camera, 12), orbit(camera, -12)))
    (task,) = pipeline_tasks(frame, target.camera, (target, third))
    seen = render(frame, target.camera)
    known = ~task.view.hole
    assert task.truth is target and 0.02 < task.view.hole.mean() < 0.5
    assert task.view.hole[seen.hole].all()
    np.testing.assert_array_equal(task.view.color[known], seen.color[known])


@pytest.mark.filterwarnings("ignore:the scale of the estimated depth")
def test_a_photo_loses_what_another_camera_does_not_see() -> None:
    """Law: the view shows the photo bit for bit where it is known and nothing elsewhere; the truth is the photo."""
    file = dlama.example() / "street.jpg"
    task = photo_task(file, 2 * SMALLEST, np.random.default_rng(3))
    hole = task.view.hole
    assert hole.any() and not hole.all() and min(hole.shape) >= SMALLEST
    np.testing.assert_array_equal(task.view.color[~hole], task.truth.color[~hole])
    assert not task.view.color[hole].any() and task.truth.color[hole].any()
