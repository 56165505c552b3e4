"""Clouds and meshes of many frames (oracles: the frames alone, closed-form surfaces and colours)."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.frames.gathering import scene
from dlama.geometry.frames.merging import nearest_depth_around
from dlama.geometry.frames.thinning import FLOOR, SIGMAS
from dlama.geometry.fusion import scene_cloud, scene_mesh
from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.kernels.visibility import Compared, drop_redundant
from dlama.geometry.projection import project, px_from_px, world_points
from dlama.geometry.rgbd import RGBD
from worlds import Box, Plane, World, moved, texture

LENS = Camera.from_fov(96, 72, 60)
WORLD = World((Plane((0, 0, 4), (0.1, 0, -1)), Box((-0.9, -0.6, 2.4), (-0.7, 2, 2.6))))
CAMERAS = [moved(LENS, (0, -8 * x, 0), (x, 0.1 * x, 0)) for x in (-0.3, 0, 0.3)]


def frames() -> list[RGBD]:
    """Three frames, the last two of .6 and .8 of the brightness."""
    made = [WORLD.rgbd(camera) for camera in CAMERAS]
    return [
        dataclasses.replace(each, color=(each.color * share).astype(np.uint8))
        for each, share in zip(made, (1, 0.6, 0.8))
    ]


def test_every_surface_is_there_once_and_equally_bright() -> None:
    """Fewer points than two frames have, all on the world's surfaces; colours are the world's by one factor."""
    given = frames()
    many = scene(given)
    cloud, mesh = scene_cloud(many), scene_mesh(many)
    assert LENS.width * LENS.height < len(cloud) < 1.6 * LENS.width * LENS.height
    assert len(mesh.vertices) < 1.8 * LENS.width * LENS.height
    assert np.median(WORLD.distance(cloud.points)) < 1e-3
    for colors, points in ((cloud.color, cloud.points), (mesh.color, mesh.vertices)):
        truth = texture(points, np.stack([shape.distance(points) for shape in WORLD.shapes]).argmin(0)).astype(float)
        ratio = colors[:, 0] / truth[:, 0]
        assert np.percentile(np.abs(ratio / np.median(ratio) - 1), 90) < 0.08


def test_points_that_other_frames_show_are_dropped() -> None:
    """Slow literal twin: each point of the middle frame, projected into the others one by one."""
    many = scene([WORLD.rgbd(camera) for camera in CAMERAS])
    frame = many.frames[1].load()
    limits = np.array([FLOOR, SIGMAS * 0.01, SIGMAS * 0.002])
    for place in (0, 2):
        other = many.frames[place].load()
        near, known = nearest_depth_around(other), other.known_depth
        expected, found = frame.valid.copy(), frame.valid.copy()
        points = world_points(frame)
        for row, column in zip(*np.nonzero(expected)):
            (pixel,), (z,) = project(points[row, column][None], other.camera)
            if not (z > 0 and (pixel >= 0).all() and (pixel < other.camera.wh).all()):
                continue
            x, y = pixel.astype(int)
            limit = max(limits[0] * z, np.hypot(limits[1], limits[2] * z**2))
            through = near[y, x] > 0 and z < near[y, x] - 2 * limit
            same = known[y, x] > 0 and abs(known[y, x] - z) <= limit
            expected[row, column] = not (through or (same and place == 0))
        compared = Compared(px_from_px(other.camera, frame.camera), as_input(known), near, place == 0)
        in_bands(drop_redundant, len(found), as_input(frame.depth), compared, limits, found)
        assert 0.02 < (~expected & frame.valid).mean() < 0.98 or place == 2
        assert (found != expected).mean() < 1e-3  # rounding to a neighbouring pixel


def test_the_scene_of_one_picture_has_all_its_points() -> None:
    """Law: nothing is left out, and nothing changes its colour."""
    given = frames()[1]
    cloud = scene_cloud(scene([given]))
    assert len(cloud) == (given.depth > 0).sum()
    np.testing.assert_array_equal(cloud.color, given.color[given.depth > 0])
