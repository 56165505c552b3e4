"""What fillers know besides the view (oracles: closed forms)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters import find_filler
from dlama.inpainters.confidence import depth_noise, features_of_known
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import inpaint
from worlds import Plane, World, moved


def test_the_sky_that_was_measured_is_known() -> None:
    """Closed form: the mean colour of the measured far pixels; a filled sky is none, and without sky there is no colour."""
    color = np.array([[(10, 20, 30), (20, 40, 50), (200, 0, 0)]], np.uint8)
    camera = Camera.from_fov(3, 1, 60)
    source = View.from_rgbd(RGBD(color, np.array([[np.inf, np.inf, 2]], np.float32), camera))
    context = FillContext.of(Scene((source,)))
    assert context.sky is not None
    np.testing.assert_array_equal(context.sky, (15, 30, 40))
    below = source.without(np.array([[True, True, False]]), HoleType.OBJECT)
    filled, _ = inpaint(below, find_filler("telea"), context)
    for scene in (Scene((below,)), Scene((below,), fills=(filled,))):
        assert FillContext.of(scene).sky is None


def test_the_context_of_a_part_keeps_sky_and_edges() -> None:
    """Closed form: the law is cropped as the view is, all else stays."""
    depth = np.arange(1, 7, dtype=np.float32).reshape(2, 3)
    depth[0, 0] = np.inf
    view = View.from_rgbd(RGBD(np.zeros((2, 3, 3), np.uint8), depth, Camera.from_fov(3, 2, 60)))
    found = FillContext.of(Scene((view,)))
    whole = FillContext(replace(found.law, misplaced_edges=True), found.sky)
    part = whole.cropped(view, slice(1, 2), slice(0, 2))
    np.testing.assert_array_equal(part.law.measured[0][1], depth[1:2, :2])
    assert part.sky is whole.sky and part.law.misplaced_edges


def test_the_noise_of_depth_that_is_drawn_without_it_is_known() -> None:
    """Closed form: exact depth has none; of noisy depth, confidence knows as much of a view drawn from aside as of the frame."""
    camera = Camera.from_fov(160, 120, 60)
    frame = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 4), (0.3, 0, -1)))).rgbd(camera)
    assert FillContext.of(Scene((View.from_rgbd(frame),))).noise == 0
    noise = np.float32(0.01) * np.random.default_rng(2).standard_normal(camera.hw, np.float32)
    source = View.from_rgbd(replace(frame, depth=frame.depth * (1 + noise)))
    context, aside = FillContext.of(Scene((source,))), render(source, moved(camera, shift=(0.2, 0, 0)))
    assert context.noise == depth_noise(source) > depth_noise(aside)
    assert (features_of_known(aside, context.noise).rows[25] == np.float32(context.noise)).all()
