"""Decimation (oracles: where the ray of each pixel meets its triangle; areas in the picture; a closed-form world's surfaces)."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.cloud import Mesh
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.drawing.grid_mesh import mesh_grid
from dlama.geometry.fusion import layer_mesh
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.layers.decimation import DecimatedMesh, decimate
from dlama.geometry.projection import project
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from marks import first_quick
from worlds import Box, Plane, Sphere, World, moved

AWAY = moved(Camera.from_fov(1, 1, 60), (5, 20, -3), (10, -20, 3)).world_from_cam
ROOM = World((Plane((0, 1.2, 0), (0, -1, 0)), Plane((0, 0, 6), (0.3, 0, -1)), Box((-0.6, -0.4, 2), (0.2, 0.5, 2.6))))
HOLLOW = World((*ROOM.shapes, Sphere((0.8, 0.2, 3), 0.6)))


def seen(world: World, width: int, height: int) -> View:
    """A world (given in camera axes) before a camera that stands askew."""
    camera = Camera.from_fov(width, height, 60, AWAY)
    home = world.rgbd(camera.at(np.eye(4)))
    return View.from_rgbd(RGBD(home.color, home.depth, camera))


def rough(seed: int, hw: tuple[int, int]) -> View:
    """Slopes, steps, noise, holes, sky and origins at random."""
    rng = np.random.default_rng(seed)
    y, x = np.indices(hw)
    w = 0.3 + rng.uniform(-1, 1, 2) @ np.stack([x.ravel(), y.ravel()]) * 0.1 / max(hw)
    depth = (1 / w.reshape(hw)).astype(np.float32)
    depth[rng.integers(hw[0]) :, rng.integers(hw[1]) :] *= 0.7
    noisy = slice(rng.integers(hw[0]), None), slice(rng.integers(hw[1]), None)
    depth[noisy] += rng.normal(0, 0.002, depth[noisy].shape).astype(np.float32)
    depth[rng.random(hw) < 0.002] *= 0.5
    depth[: rng.integers(hw[0] + 1), : rng.integers(hw[1] + 1)] = np.inf
    view = View.from_rgbd(RGBD(rng.integers(0, 256, (*hw, 3)).astype(np.uint8), depth, Camera.from_fov(*hw[::-1], 50)))
    origin = np.where(x + y < rng.integers(sum(hw)), view.origin, np.uint8(Origin.DEPTH_FILLED))
    return dataclasses.replace(view, origin=origin).without(rng.random(hw) < 0.003, HoleType.SENSOR)


def in_picture(mesh: Mesh, camera: Camera) -> np.ndarray:
    """M x 3 x 2: corners of the triangles, px."""
    return project(mesh.vertices, camera)[0][mesh.triangles]


def areas(mesh: Mesh, camera: Camera) -> np.ndarray:
    """M, px^2, positive where corners run counter-clockwise."""
    one, two, three = in_picture(mesh, camera).transpose(1, 2, 0)
    return ((two - one)[1] * (three - one)[0] - (two - one)[0] * (three - one)[1]) / 2


def inside_of(corners: np.ndarray, hw: tuple[int, int]) -> np.ndarray:
    """N x 2 rows and columns of the pixels whose centres lie in a triangle or on its rim."""
    low, high = np.ceil(corners.min(0) - 0.5 - 1e-6).astype(int), np.floor(corners.max(0) - 0.5 + 1e-6).astype(int)
    x, y = (part.ravel() for part in np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(low, high))))
    inside = np.ones(len(x), bool)
    for one, two in itertools.pairwise((*corners, corners[0])):
        along = two - one
        inside &= along[1] * (x + 0.5 - one[0]) - along[0] * (y + 0.5 - one[1]) >= -1e-4
    return np.stack([y, x], 1)[inside]


def shares_of_corners(corners: np.ndarray, camera: Camera, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """3 x N: of the corners (3 x 3, in camera axes), of a point at depth 1 on the ray of each pixel."""
    rays = np.stack([(columns + 0.5 - camera.cx) / camera.fx, (rows + 0.5 - camera.cy) / camera.fy, np.ones(len(rows))])
    return np.linalg.solve(corners.T, rays)


def surface_under(mesh: Mesh, camera: Camera) -> np.ndarray:
    """H x W metres at which the rays of the pixels first meet a mesh; 0 where they meet none."""
    depth = np.zeros(camera.hw)
    in_camera = (mesh.vertices - camera.world_from_cam[:3, 3]) @ camera.world_from_cam[:3, :3]
    for corners, numbers in zip(in_picture(mesh, camera), mesh.triangles):
        rows, columns = inside_of(corners, camera.hw).T
        met = 1 / shares_of_corners(in_camera[numbers], camera, rows, columns).sum(0)
        before = depth[rows, columns]
        depth[rows, columns] = np.where(before > 0, np.minimum(before, met), met)
    return depth


def most_around(origin: np.ndarray) -> np.ndarray:
    """H x W: of pixels that are measured, or filled in depth, which of the two most in 5 x 5 are; literal twin."""
    out = origin.copy()
    padded = np.pad(origin == Origin.DEPTH_FILLED, 2, mode="edge")
    for row, column in np.argwhere((origin == Origin.MEASURED) | (origin == Origin.DEPTH_FILLED)):
        most = padded[row : row + 5, column : column + 5].sum() > 12
        out[row, column] = Origin.DEPTH_FILLED if most else Origin.MEASURED
    return out


def check(view: View, found: DecimatedMesh, share: float = 0.001, noise: float = 0.0) -> None:
    """All that `decimate` promises; noise: standard deviation of inverse depth (1/m)."""
    mesh, camera = found.mesh, view.camera
    depth, joined = mesh_grid(view)
    origin = most_around(view.origin)
    in_camera = (mesh.vertices - camera.world_from_cam[:3, 3]) @ camera.world_from_cam[:3, :3]
    shown = np.zeros(camera.hw, bool)
    every = in_picture(mesh, camera)
    for corners, numbers in zip(every, mesh.triangles):
        cells = inside_of(corners, camera.hw)
        rows, columns = cells.T
        shown[rows, columns] = True
        shares = shares_of_corners(in_camera[numbers], camera, rows, columns)
        met = 1 / shares.sum(0)
        expected = depth[rows, columns].astype(np.float64)
        most = np.maximum(np.maximum(0.001, share * expected), 3 * noise * expected**2)
        assert (np.abs(met - expected) <= most * 1.0001 + 1e-6).all()
        texture = found.pixels[numbers].T @ (shares * met)
        assert (np.hypot(*(texture - (columns + 0.5, rows + 0.5))) <= 0.5 + 1e-4).all() or len(cells) == 1
        members = {(int(row), int(column)) for row, column in cells}
        for row, column in members:
            if len(members) > 3:
                assert (row, column + 1) not in members or joined[row, column] & RIGHT
                assert (row + 1, column) not in members or joined[row, column] & DOWN
        if len(members) > 3:
            assert len(np.unique(origin[rows, columns])) == 1
    surface = (depth > 0) & (depth < np.inf)
    np.testing.assert_array_equal(found.surface, surface)
    np.testing.assert_array_equal(shown, surface)
    whole, parts = areas(layer_mesh(view), camera), areas(mesh, camera)
    assert (parts > 0).all()
    lone = np.abs((every[:, 0] % 1) - 0.5).max(1) > 0.25  # corners of squares lie between pixels
    np.testing.assert_allclose(parts[~lone].sum(), whole.sum(), rtol=1e-6)
    rows, columns = (found.pixels[:, [1, 0]] - 0.5).astype(int).T
    np.testing.assert_array_equal(mesh.color, view.color[rows, columns])
    np.testing.assert_array_equal(mesh.origin, view.origin[rows, columns])
    np.testing.assert_array_equal(mesh.confidence, view.confidence[rows, columns])


@pytest.mark.parametrize("size", [(80, 60), (65, 65), (2, 2), (2, 70)])
@pytest.mark.parametrize("world", first_quick([HOLLOW, ROOM]))
def test_planes_steps_and_a_ball(world: World, size: tuple[int, int]) -> None:
    """Every pixel is met within the tolerance, by triangles that tile what the whole grid's tile and span no edge."""
    view = seen(world, *size)
    check(view, decimate(view))


def test_the_check_can_fail() -> None:
    """Of a surface 1 % farther away, and of one with a triangle left out."""
    view = seen(ROOM, 65, 65)
    found = decimate(view)
    shifted = dataclasses.replace(view, depth=view.depth * np.float32(1.01))
    lacking = dataclasses.replace(found.mesh, triangles=found.mesh.triangles[1:])
    for wrong in (decimate(shifted), found._replace(mesh=lacking)):
        with pytest.raises(AssertionError):
            check(view, wrong)


@pytest.mark.parametrize("seed", first_quick(range(5), 2))
def test_rough_ground(seed: int) -> None:
    """The same of random depth; sizes at random."""
    rng = np.random.default_rng(seed)
    view = rough(seed, (int(rng.integers(2, 70)), int(rng.integers(2, 70))))
    check(view, decimate(view))


def test_estimated_depth_takes_fewer_triangles() -> None:
    """The same within 0.5 %, which 0.1 % does not allow."""
    view = seen(HOLLOW, 120, 90)
    waves = view.depth * (1 + 0.003 * np.sin(np.indices((90, 120))[1])).astype(np.float32)
    estimated = dataclasses.replace(view, depth=waves, origin=np.full_like(view.origin, Origin.ESTIMATED))
    found = decimate(estimated)
    check(estimated, found, 0.005)
    assert len(found.mesh.triangles) < len(decimate(estimated, 0.001).mesh.triangles) / 2


def with_noise(view: View, sigma: float, seed: int) -> View:
    """The view with noise of that standard deviation (1/m) in its inverse depth."""
    noise = np.random.default_rng(seed).normal(0, sigma, view.depth.shape)
    return dataclasses.replace(view, depth=(1 / (1 / view.depth + noise)).astype(np.float32))


@pytest.mark.slow
def test_noisy_depth_takes_fewer_triangles_and_is_no_worse() -> None:
    """The promises within three standard deviations of noise that was added; the exact depth before it was."""
    exact, sigma = seen(ROOM, 128, 96), 0.001
    noisy = with_noise(exact, sigma, 0)
    found = decimate(noisy)
    check(noisy, found, noise=1.15 * sigma)  # it is measured by no more than 15 % wrong
    assert len(found.mesh.triangles) < len(decimate(noisy, 0.001).mesh.triangles) / 2
    depth = surface_under(found.mesh, exact.camera)
    missed = 1 / depth[depth > 0] - 1 / exact.depth[depth > 0]
    assert np.sqrt((missed**2).mean()) < sigma


def test_flat_is_few() -> None:
    """A wall that faces the camera: two triangles for 64 x 64 pixels; a floor up to its horizon: a fortieth of the grid's."""
    wall = seen(World((Plane((0, 0, 4), (0, 0, -1)),)), 513, 257)
    assert len(decimate(wall).mesh.triangles) == 8 * 4 * 2
    floor = seen(World((Plane((0, 1.5, 0), (0, -1, 0.05)),)), 512, 512)
    assert len(decimate(floor).mesh.triangles) < len(layer_mesh(floor).triangles) / 40


def test_specks_without_depth_cost_no_triangles() -> None:
    """Law: a floor of which a sensor left a tenth of the pixels open, since filled, has as many triangles as the floor."""
    floor = seen(World((Plane((0, 1.5, 0), (0, -1, 0.05)),)), 256, 256)
    specks = np.random.default_rng(0).random(floor.camera.hw) < 0.1
    open_ = dataclasses.replace(floor, origin=np.where(specks, np.uint8(Origin.DEPTH_FILLED), floor.origin))
    assert len(decimate(open_).mesh.triangles) == len(decimate(floor).mesh.triangles)


@pytest.mark.parametrize("hw", [(1, 1), (1, 9), (9, 1)])
def test_a_line_of_pixels_is_squares(hw: tuple[int, int]) -> None:
    """No triangle fits between them: each pixel becomes a square of its own size."""
    view = View.from_rgbd(RGBD(np.zeros((*hw, 3), np.uint8), np.ones(hw, np.float32), Camera.from_fov(*hw[::-1], 50)))
    found = decimate(view)
    np.testing.assert_allclose(areas(found.mesh, view.camera), 0.5)
    assert len(found.mesh.triangles) == 2 * hw[0] * hw[1]


def test_without_surface_it_is_empty() -> None:
    """Sky alone."""
    camera = Camera.from_fov(8, 6, 50)
    sky = View.from_rgbd(RGBD(np.zeros((6, 8, 3), np.uint8), np.full((6, 8), np.inf, np.float32), camera))
    assert len(decimate(sky).mesh.vertices) == len(decimate(sky).mesh.triangles) == 0
