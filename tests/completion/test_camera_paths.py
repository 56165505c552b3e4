"""A camera path through a scene that was filled for some of its cameras (oracles: what the world says each camera sees, filled
points are the same in all views, closed forms of paths)."""

from __future__ import annotations

import functools
import itertools

import numpy as np
import pytest
import small_street

import dlama
from dlama.completion.completion import Completion
from dlama.completion.pipeline import complete
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import Origin
from dlama.geometry.fusion import scene_cloud
from dlama.geometry.motion.trajectories import PATHS, interpolate_cameras, orbit
from dlama.geometry.rendering import render
from dlama.geometry.scene import contribution
from worlds import Box, Plane, World, moved

CAMERA = Camera.from_fov(160, 120, 70)
INDOORS = World((Plane((0, 0, 5), (0, 0, -1)), Plane((0, 1, 0), (0, -1, 0)), Box((-0.9, -0.4, 2.4), (-0.1, 1, 2.8))))
OUTDOORS = World(
    (Plane((0, 1, 0), (0, -1, 0)), Box((-30, -1.2, 7), (0.5, 1, 9)), Box((-0.9, -0.4, 2.4), (-0.1, 1, 2.8)))
)
HORIZON = 30.0
"""Metres; beyond, half a pixel of filled depth decides whether there is ground or sky."""
YAWS = (-24.0, -8.0, 14.0, 26.0)
BETWEEN = (-20.0, -16.0, -12.0, -4.0, 3.0, 7.0, 11.0, 18.0, 22.0)

worlds = pytest.mark.parametrize("world", [INDOORS, OUTDOORS], ids=["indoors", "outdoors"])


@functools.cache
def filled(world: World) -> Completion:
    """The scene completed for the cameras of YAWS."""
    return complete(world.rgbd(CAMERA), [orbit(CAMERA, yaw) for yaw in YAWS])


@pytest.mark.slow
@worlds
def test_no_hole_opens_where_one_of_the_cameras_saw_what_is_there(world: World) -> None:
    """Law: between the cameras that were filled, every surface that the source or one of them sees is drawn: indoors all, and
    outdoors, where a guess may put sky in place of a wall, all but 1 in 1000."""
    done = filled(world)
    seen_from = [CAMERA, *(orbit(CAMERA, yaw) for yaw in YAWS)]
    for yaw in BETWEEN:
        camera = orbit(CAMERA, yaw)
        union = np.logical_or.reduce([world.seen_by(one, camera) for one in seen_from])
        union &= world.trace(camera)[0] < HORIZON
        view = render(done.scene, camera)
        assert union.mean() > 0.5
        assert (view.hole & union).mean() <= (0 if world is INDOORS else 0.001), yaw


def test_sky_stays_sky_between_the_cameras() -> None:
    """Law: at most 0.5 % of the world's sky stays open; closing draws sky over at most 0.1 % of a view that is none."""
    done, drawn = filled(OUTDOORS), 0
    for yaw in BETWEEN:
        camera = orbit(CAMERA, yaw)
        sky = np.isinf(OUTDOORS.trace(camera)[0])
        view, plain = render(done.scene, camera), render(done.scene, camera, close=False)
        assert (view.hole & sky).sum() <= 0.005 * sky.sum(), yaw
        closed = plain.hole & view.far
        assert (closed & ~sky).mean() <= 0.001, yaw
        drawn += int(closed.sum())
    assert drawn > 0


@worlds
def test_what_is_closed_is_not_called_measured(world: World) -> None:
    """Law: pixels that only closing draws are FILLED and less sure than what was measured; all others keep their bits."""
    scene, camera = filled(world).scene, orbit(CAMERA, -16.0)
    whole, plain = render(scene, camera), render(scene, camera, close=False)
    closed = plain.hole & ~whole.hole
    assert (whole.origin[closed] == Origin.FILLED).all() and (whole.confidence[closed] < 1).all()
    for name in ("color", "depth", "origin", "confidence"):
        np.testing.assert_array_equal(getattr(whole, name)[~closed], getattr(plain, name)[~closed])


def test_what_was_left_open_stays_open() -> None:
    """Law: a scene that was thinned by confidence is not closed."""
    done, camera = filled(OUTDOORS).with_min_confidence(0.5), orbit(CAMERA, -16.0)
    np.testing.assert_array_equal(render(done.scene, camera).hole, render(done.scene, camera, close=False).hole)


@worlds
def test_no_layer_of_a_path_adds_what_is_there_already(world: World) -> None:
    """Counts: the cloud has each measured pixel once, and of each later view what was filled anew; the overlap with an earlier
    fill keeps its origin, so that what is filled is never called seen."""
    done = filled(world)
    layers = done.scene.layers
    assert len(scene_cloud(done.scene)) == sum(int(contribution(layer).sum()) for layer in layers)
    assert contribution(layers[0]).sum() == done.source.valid.sum()
    overlaps = 0
    for layer, before in zip(layers[1:], done.warped):
        added = contribution(layer)
        assert (layer.origin[added] == Origin.FILLED).all() and before.hole[added].all()
        ring = layer.valid & ~added
        np.testing.assert_array_equal(layer.origin[ring] == Origin.FILLED, before.hole[ring])
        overlaps += int((ring & before.hole).sum())
    assert overlaps > 100


def test_nothing_flickers() -> None:
    """Seen again from the next camera of a slow path, what was filled has the same colour (median 2 levels) and depth (0.1 %)."""
    scene = dlama.scene([small_street.street(orbit(small_street.CAMERA, yaw, 0.0, 3.0)) for yaw in (-4.0, 4.0)])
    path = PATHS["orbit"](small_street.CAMERA, 24, 3.0)[:6]
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
    done = dlama.view(small_street.street(), yaw=8)
    assert [
        view.hole.any()
        for view in dlama.render_path(done.scene, [small_street.CAMERA, orbit(small_street.CAMERA, 4.0)])
    ] == [False, False]
    with pytest.raises(InputError, match="cameras is empty"):
        dlama.render_path(done.scene, [])
    with pytest.raises(InputError, match="seed is -1"):  # at the call, not at the first view
        dlama.render_path(done.scene, [small_street.CAMERA], seed=-1)


def test_paths_by_name_begin_at_the_camera_and_close() -> None:
    """Closed forms: first camera, even steps that a last one would complete, the same lens."""
    for name in PATHS:
        path = PATHS[name](small_street.CAMERA, 40)
        np.testing.assert_allclose(path[0].world_from_cam, small_street.CAMERA.world_from_cam, atol=1e-12)
        steps = [
            np.linalg.norm((a.world_from_cam - b.world_from_cam)[:3, 3]) for a, b in zip(path, [*path[1:], path[0]])
        ]
        assert max(steps) < 0.15 and all(camera.same_lens_as(small_street.CAMERA) for camera in path)


def test_between_cameras() -> None:
    """Closed form: half-way of a turn and a shift; the ends themselves."""
    other = moved(small_street.CAMERA, (0, 30, 0), (1, 0, 0))
    path = interpolate_cameras([small_street.CAMERA, other], 3)
    np.testing.assert_allclose(path[0].world_from_cam, small_street.CAMERA.world_from_cam, atol=1e-12)
    np.testing.assert_allclose(path[2].world_from_cam, other.world_from_cam, atol=1e-12)
    np.testing.assert_allclose(
        path[1].world_from_cam[:3, :3], moved(small_street.CAMERA, (0, 15, 0)).world_from_cam[:3, :3], atol=1e-12
    )
    np.testing.assert_allclose(path[1].world_from_cam[:3, 3], (0.5, 0, 0), atol=1e-12)
    assert len(interpolate_cameras([small_street.CAMERA], 2)) == 2
