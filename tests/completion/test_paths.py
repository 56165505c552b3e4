"""dlama.render_path: views along a path (oracles: filled points are the same in all views, closed forms of paths)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from small_street import CAMERA, street

import dlama
from dlama.errors import InputError
from dlama.geometry.motion.trajectories import PATHS, interpolate_cameras, orbit
from worlds import moved


def test_nothing_flickers() -> None:
    """Seen again from the next camera of a slow path, what was filled has the same colour (median 2 levels) and depth (0.1 %)."""
    scene = dlama.scene([street(orbit(CAMERA, yaw, 0.0, 3.0)) for yaw in (-4.0, 4.0)])
    path = PATHS["orbit"](CAMERA, 24, 3.0)[:6]
    views = list(dlama.render_path(scene, path))
    assert len(views) == 6 and not any(view.hole.any() for view in views)
    depths, colors = [], []
    for one, other in itertools.pairwise(
        views
    ):  # the first views have a few filled pixels, at rims, where views interpolate
        shown = dlama.render(one, other.camera)
        both = (shown.origin == dlama.Origin.FILLED) & other.valid & shown.valid & other.filled
        assert both.any()
        depths.append(np.abs(shown.depth[both] - other.depth[both]) / other.depth[both])
        colors.append(np.abs(shown.color.astype(int) - other.color)[both])
    depth, color = np.concatenate(depths), np.concatenate(colors)
    assert len(depth) > 1000
    assert np.median(depth) < 1e-3 and np.median(color) <= 2


def test_a_completed_picture_is_a_scene() -> None:
    """The scene of one picture takes a path, too."""
    done = dlama.view(street(), yaw=8)
    assert [view.hole.any() for view in dlama.render_path(done.scene, [CAMERA, orbit(CAMERA, 4.0)])] == [False, False]
    with pytest.raises(InputError, match="cameras is empty"):
        dlama.render_path(done.scene, [])


def test_paths_by_name_begin_at_the_camera_and_close() -> None:
    """Closed forms: first camera, even steps that a last one would complete, the same lens."""
    for name in PATHS:
        path = PATHS[name](CAMERA, 40)
        np.testing.assert_allclose(path[0].world_from_cam, CAMERA.world_from_cam, atol=1e-12)
        steps = [
            np.linalg.norm((a.world_from_cam - b.world_from_cam)[:3, 3]) for a, b in zip(path, [*path[1:], path[0]])
        ]
        assert max(steps) < 0.15 and all(camera.same_lens_as(CAMERA) for camera in path)


def test_between_cameras() -> None:
    """Closed form: half-way of a turn and a shift; the ends themselves."""
    other = moved(CAMERA, (0, 30, 0), (1, 0, 0))
    path = interpolate_cameras([CAMERA, other], 3)
    np.testing.assert_allclose(path[0].world_from_cam, CAMERA.world_from_cam, atol=1e-12)
    np.testing.assert_allclose(path[2].world_from_cam, other.world_from_cam, atol=1e-12)
    np.testing.assert_allclose(
        path[1].world_from_cam[:3, :3], moved(CAMERA, (0, 15, 0)).world_from_cam[:3, :3], atol=1e-12
    )
    np.testing.assert_allclose(path[1].world_from_cam[:3, 3], (0.5, 0, 0), atol=1e-12)
    assert len(interpolate_cameras([CAMERA], 2)) == 2
