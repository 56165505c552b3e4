"""Subsampling (oracles: points in space, means by hand)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.layers.subsampling import step_for, subsample, subsample_scene
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View


def frame() -> View:
    """Noise before a slope."""
    rng = np.random.default_rng(0)
    depth = rng.uniform(2, 3, (31, 44)).astype(np.float32)
    return View.from_rgbd(RGBD(rng.integers(0, 256, (31, 44, 3), dtype=np.uint8), depth, Camera.from_fov(44, 31, 60)))


@pytest.mark.parametrize("step", [2, 3, 5])
def test_points_stay_where_they_are(step: int) -> None:
    """Every point of the smaller layer is one of the larger."""
    small = subsample(frame(), step)
    rows, columns = np.mgrid[step // 2 : 31 // step * step : step, step // 2 : 44 // step * step : step]
    large = lift(frame()).points.reshape(31, 44, 3)[rows, columns]
    assert np.allclose(lift(small).points, large.reshape(-1, 3), atol=1e-6)


def test_colors_are_means_of_what_is_known() -> None:
    """Two of four pixels are holes: the mean of the other two."""
    view = frame()
    hole = np.zeros((31, 44), bool)
    hole[0:2, 0] = True
    small = subsample(view.without(hole, HoleType.DISOCCLUDED), 2)
    assert np.abs(small.color[0, 0] - view.color[0:2, 1].mean(0)).max() <= 1
    assert np.abs(small.color[3, 4] - view.color[6:8, 8:10].mean((0, 1))).max() <= 1


def test_the_step_follows_the_size() -> None:
    """31 x 44 = 1364 pixels: 400 of them need step 2, all of them none."""
    scene = Scene((frame(),))
    assert (step_for(31 * 44, 2000), step_for(31 * 44, 400)) == (1, 2)
    assert subsample_scene(scene, 1) is scene and subsample_scene(scene, 2).frames[0].camera.wh == (22, 15)
