"""The rendering kernels against their slow literal twins (tests/reference), value by value, on small random grids."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.depth_noise import Noise
from dlama.geometry.drawing import grid_mesh
from dlama.geometry.drawing.grid_mesh import close_grid, find_joints, mesh_grid
from dlama.geometry.drawing.picture_edges import edge_ratio
from dlama.geometry.kernels.drawing.rasterize import NEAR
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from marks import first_quick
from reference import edges, far, points, rasteriser, sheet
from worlds import moved, pixels_of, points_of, random_camera

SEEDS = first_quick(range(12), 4)
RIGHT, DOWN = 1, 2


def random_frame(rng: np.random.Generator, height: int = 9, width: int = 11) -> RGBD:
    """Two bumpy, inclined surfaces at about 2 m and 4 m, lone pixels between, before and behind them, sky, missing."""
    v, u = np.mgrid[:height, :width]
    w = 0.25 + rng.uniform(-0.01, 0.01) * u + rng.uniform(-0.01, 0.01) * v
    nearer = u * rng.uniform(-1, 1) + v * rng.uniform(-1, 1) > rng.uniform(-2, 2)
    w = np.where(nearer, w * 2, w) * (1 + 0.004 * rng.standard_normal((height, width)))
    lone = rng.random((height, width))
    w = np.where(lone < 0.06, w * rng.uniform(0.6, 1.6, w.shape), w)
    depth = (1 / w).astype(np.float32)
    depth[(lone > 0.9) & (lone < 0.95)] = 0
    depth[(lone > 0.97) | ((v < 2) & (u > 7))] = np.inf
    return RGBD(rng.integers(0, 256, (height, width, 3), np.uint8), depth, random_camera(rng, width, height))


def random_target(rng: np.random.Generator, source: Camera, width: int = 13, height: int = 10) -> Camera:
    """Another lens, some steps aside, turned; every third time far aside, or close to the scene."""
    lens = random_camera(rng, width, height).at(source.world_from_cam)
    reach = (0.3, 0.3, 1.5)[rng.integers(3)]
    return moved(lens, tuple(rng.uniform(-20, 20, 3) * reach), tuple(rng.uniform(-1.2, 1.2, 3) * reach))


def pair(seed: int) -> tuple[RGBD, Camera, np.random.Generator]:
    """A frame, a camera elsewhere, and what chance is left."""
    rng = np.random.default_rng(seed)
    frame = random_frame(rng)
    return frame, random_target(rng, frame.camera), rng


def without_sky(frame: RGBD, rng: np.random.Generator) -> View:
    """The frame's finite surfaces as a view whose pixels carry any origin and any confidence."""
    view = View.from_rgbd(RGBD(frame.color, np.where(np.isinf(frame.depth), 0, frame.depth), frame.camera))
    origin = rng.integers(1, 5, frame.depth.shape).astype(np.uint8)
    return dataclasses.replace(view, origin=origin, confidence=rng.random(origin.shape, np.float32))


def carried(view: View, row: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origin and confidence that pixels of a view carry into another: what was measured becomes reprojected."""
    origin = view.origin[row, column]
    return np.where(origin == Origin.MEASURED, Origin.REPROJECTED, origin), view.confidence[row, column]


def mesh_of(frame: RGBD, least: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth without flying pixels, right and lower joints, all from the twins."""
    ratio = edge_ratio(frame.camera)
    depth = np.where(edges.flying(inverse_depth(frame.depth), ratio, least), np.float32(0), frame.depth)
    return depth, *edges.joints(inverse_depth(depth), ratio, least)


def assert_joined(frame: RGBD, least: float = 0.0) -> None:
    """Depth without flying pixels and joints of a frame's grid are the twins'."""
    depth, joined = mesh_grid(dataclasses.replace(View.from_rgbd(frame), noise_step=least))
    twin_depth, right, down = mesh_of(frame, least)
    np.testing.assert_array_equal(depth, twin_depth)
    np.testing.assert_array_equal((joined & RIGHT)[:, :-1] > 0, right)
    np.testing.assert_array_equal((joined & DOWN)[:-1] > 0, down)


@pytest.mark.parametrize("least", [0.0, 0.03])
@pytest.mark.parametrize("seed", SEEDS)
def test_joints_and_flying_pixels(seed: int, least: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Twin: every joint and every flying pixel of the grid, whatever noise there is."""
    monkeypatch.setattr(grid_mesh, "noise_of_lines", lambda *_: Noise(0.0, 0.0, 0.0))
    frame, _, _ = pair(seed)
    view = dataclasses.replace(View.from_rgbd(frame), noise_step=least)
    w = inverse_depth(frame.depth)
    np.testing.assert_array_equal(find_joints(view).flying, edges.flying(w, edge_ratio(frame.camera), least))
    assert_joined(frame, least)


@pytest.mark.parametrize("seed", SEEDS)
def test_slopes_are_joined(seed: int) -> None:
    """Twin: joints of steep planes with noise, gaps and an edge, where a step is judged by its neighbours."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:8, :9]
    w = 0.05 + 0.02 * rng.random() * u + 0.02 * rng.random() * v + 0.0005 * rng.standard_normal(u.shape)
    w = (w + 0.15 * (u > 5)) * (rng.random(w.shape) > 0.04)
    depth = np.divide(1, w, out=np.zeros_like(w), where=w > 0).astype(np.float32)
    assert_joined(RGBD(np.zeros((8, 9, 3), np.uint8), depth, Camera.from_fov(9, 8, 1)))


@pytest.mark.parametrize("seed", SEEDS)
def test_points_mode(seed: int) -> None:
    """Twin: depth, colour, origin and confidence of the nearest point in every target pixel; empty where there is none."""
    frame, target, rng = pair(seed)
    source = without_sky(frame, rng)
    depth, _, _ = mesh_of(RGBD(source.color, source.depth, source.camera))
    reported, index, unsure = points.nearest_points(depth, source.camera, target, NEAR)
    view = render(source, target, "points")
    assert unsure.mean() < 0.05
    np.testing.assert_array_equal(view.hole[~unsure], reported[~unsure] == 0)
    np.testing.assert_allclose(view.depth[~unsure], reported[~unsure], rtol=1e-6)
    seen = ~unsure & (index >= 0)
    row, column = np.divmod(index[seen], depth.shape[1])
    np.testing.assert_array_equal(view.color[seen], source.color[row, column])
    origin, confidence = carried(source, row, column)
    np.testing.assert_array_equal(view.origin[seen], origin)
    np.testing.assert_array_equal(view.confidence[seen], confidence)


@pytest.mark.parametrize("seed", SEEDS)
def test_surface_mode(seed: int) -> None:
    """Twin: depth to 1e-3 (float32 corners of small triangles), colour to one level, where no silhouette decides.

    Origin and confidence are the nearest source pixel's.
    """
    frame, target, rng = pair(seed)
    source = without_sky(frame, rng)
    depth, right, down = mesh_of(RGBD(source.color, source.depth, source.camera))
    reported = rasteriser.draw(depth, right, down, source.camera, target, NEAR)
    sure = ~reported.unsure
    assert sure.mean() > 0.85
    view = render(source, target, fine=False)
    np.testing.assert_array_equal(view.hole[sure], reported.depth[sure] == 0)
    np.testing.assert_allclose(view.depth[sure], reported.depth[sure], rtol=1e-3)
    off = np.abs(view.color - rasteriser.shade(reported, right, down, frame.color))[sure]
    assert off.max(initial=0) <= 1.5
    seen = sure & (reported.depth > 0) & (np.abs(reported.where % 1 - 0.5).min(-1) > 0.01)  # a nearest pixel there is
    column, row = reported.where[seen].round().astype(int).T
    origin, confidence = carried(source, row, column)
    np.testing.assert_array_equal(view.origin[seen], origin)
    np.testing.assert_array_equal(view.confidence[seen], confidence)


def calm_frame(rng: np.random.Generator, height: int = 22, width: int = 26) -> RGBD:
    """Two inclined planes in bright noise; some lone pixels missing."""
    v, u = np.mgrid[:height, :width]
    w = 0.25 + rng.uniform(-0.003, 0.003) * u + rng.uniform(-0.003, 0.003) * v
    w = np.where(u * rng.uniform(-1, 1) + v * rng.uniform(-1, 1) > rng.uniform(-10, 30), 2 * w, w)
    depth = np.where(rng.random(w.shape) < 0.005, 0, 1 / w).astype(np.float32)
    return RGBD(rng.integers(0, 256, (height, width, 3), np.uint8), depth, random_camera(rng, width, height))


@pytest.mark.parametrize("seed", SEEDS)
def test_fine_colors(seed: int) -> None:
    """Twin with scipy's spline: colour to one level. The target is smaller than the source, so places are averaged."""
    rng = np.random.default_rng(seed)
    frame = calm_frame(rng)
    lens = frame.camera
    width, height = (13, 10) if seed % 2 else (26, 20)
    small = Camera(width, height, lens.fx * width / 26, lens.fy * height / 22, width / 2, height / 2)
    target = moved(small.at(lens.world_from_cam), tuple(rng.uniform(-6, 6, 3)), tuple(rng.uniform(-0.3, 0.3, 3)))
    depth, right, down = mesh_of(frame)
    reported = rasteriser.draw(depth, right, down, frame.camera, target, NEAR)
    color, counts, unsure = rasteriser.shade_finely(reported, right, down, frame.color)
    assert (~unsure).mean() > 0.6
    assert (counts == 1).any() if seed % 2 == 0 else (counts > 1).any()
    off = np.abs(render(frame, target).color - color)[~unsure]
    assert off.max() <= 1.5
    coarse = np.abs(render(frame, target, fine=False).color - color)[~unsure]
    assert coarse.max() > 10  # what the test would miss


@pytest.mark.parametrize("seed", SEEDS)
def test_far_layer(seed: int) -> None:
    """Twin: sky and its colour in every direction; what is no sky is a hole."""
    frame, target, rng = pair(seed)
    far_mask = rng.random(frame.depth.shape) < 0.8
    frame = RGBD(frame.color, np.where(far_mask, np.inf, 0).astype(np.float32), frame.camera)
    shown, color, unsure = far.sky(far_mask, frame.color, frame.camera, target)
    view = render(frame, target)
    assert unsure.mean() < 0.05
    np.testing.assert_array_equal(view.far[~unsure], shown[~unsure])
    np.testing.assert_array_equal(view.hole, ~view.far)
    assert np.abs(view.color - color)[~unsure].max() <= 0.51


def test_fine_sky() -> None:
    """Twin with scipy's spline: clouds seen from a camera that turned, where 8 x 8 pixels are sky."""
    from scipy.ndimage import map_coordinates

    rng = np.random.default_rng(0)
    camera = Camera.from_fov(40, 30, 60)
    color = rng.integers(0, 256, (30, 40, 3), np.uint8)
    frame = RGBD(color, np.full(camera.hw, np.inf, np.float32), camera)
    target = moved(camera, (4, -3, 2))
    view = render(frame, target)
    u, v, _ = pixels_of(camera, points_of(target, np.ones(target.hw)) - target.world_from_cam[:3, 3])
    inside = (u > 4) & (u < 36) & (v > 4) & (v < 26)
    assert inside.mean() > 0.6
    planes = color.astype(float).transpose(2, 0, 1)
    reported = np.stack([map_coordinates(plane, [v - 0.5, u - 0.5], order=3, mode="mirror") for plane in planes], -1)
    assert np.abs(view.color - np.clip(reported, 0, 255))[inside].max() <= 1.5


@pytest.mark.parametrize("mode", ["surface", "points"])
@pytest.mark.parametrize("seed", SEEDS)
def test_hole_types(seed: int, mode: str) -> None:
    """Twin: the type of every hole, from the closed grid stretched over the target, quad by quad."""
    frame, target, rng = pair(seed)
    source = View.from_rgbd(frame)
    gone = np.zeros(frame.depth.shape, np.bool_)
    gone[3:6, 2:5] = rng.random() < 0.5
    scene = Scene((source.without(gone, HoleType.OBJECT),), (source.without(~gone, HoleType.NONE),))
    view = render(scene, target, mode)  # type: ignore[arg-type]
    reported, unsure = types_of(scene, target, view.hole, crack_rank=5 if mode == "points" else 1)
    assert unsure.mean() < 0.1
    np.testing.assert_array_equal(view.hole_type[~unsure], reported[~unsure])


def types_of(scene: Scene, target: Camera, hole: np.ndarray, crack_rank: int) -> tuple[np.ndarray, np.ndarray]:
    """Hole types from the twin of the sheet, and where rounding decides."""
    layer = scene.layers[0]
    depth, own = close_grid(layer, scene.removals)
    x, y, z = pixels_of(target, points_of(layer.camera, depth.astype(np.float64)))
    mesh_depth, right, down = mesh_of(RGBD(layer.color, layer.depth, layer.camera))
    flying_rank, loose, strict = np.zeros((3, *hole.shape), np.uint8)
    for row, column in zip(*np.nonzero((mesh_depth == 0) & layer.valid)):
        tx, ty = np.floor([x[row, column], y[row, column]]).astype(int)
        if z[row, column] > NEAR and 0 <= tx < target.width and 0 <= ty < target.height:
            flying_rank[ty, tx] = 3
    for out, grow in ((loose, sheet.MARGIN), (strict, -sheet.MARGIN)):
        out[:] = sheet.ranks(x, y, z, right, down, own, NEAR, crack_rank, hole, grow)
    names = ["OUT_OF_VIEW", "DISOCCLUDED", "SENSOR", "FLYING", "OBJECT", "CRACK"]  # the later one wins
    codes = np.array([HoleType[name] for name in names], np.uint8)
    return codes[np.maximum(loose, flying_rank)] * hole, loose != strict
