"""Fusion: what a filled view adds to a scene, and the scene as one cloud and one mesh."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.errors import ShapeError
from dlama.geometry import fusion
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import Mesh
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.fusion import OVERLAP, fuse, layer_mesh, scene_cloud, scene_mesh
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters import find_filler
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import inpaint
from reference.rasteriser import triangles_of
from worlds import Box, Plane, Sphere, World, moved, pixels_of, points_of, rgbd_of

CAMERA = Camera.from_fov(48, 36, 60, moved(Camera.from_fov(1, 1, 60), (5, 20, -3), (10, -20, 3)).world_from_cam)
WALL = Plane((0, 0, 4), (0.2, 0, -1))


def frame_of(*shapes: Plane | Sphere | Box) -> RGBD:
    """The shapes (given in camera axes) before CAMERA: built at the origin, then carried to CAMERA's pose."""
    home = World(shapes).rgbd(CAMERA.at(np.eye(4)))
    return RGBD(home.color, home.depth, CAMERA)


def half_filled() -> tuple[Scene, View]:
    """A wall whose right half was removed and filled: the scene before fusing, and the filled view."""
    source = View.from_rgbd(frame_of(WALL))
    taken = np.zeros(CAMERA.hw, bool)
    taken[:, 24:] = True
    scene = Scene((source.without(taken, HoleType.OBJECT),))
    return scene, inpaint(scene.layers[0], find_filler("layered"), FillContext(Law(())))[0]


def test_the_new_layer_is_what_was_filled_and_a_rim() -> None:
    """Closed form: the right half FILLED, OVERLAP columns of known neighbours REPROJECTED, the rest a hole; old layers stay."""
    scene, filled = half_filled()
    fused = fuse(scene, filled)
    assert len(fused.layers) == 2 and fused.layers[0] is scene.layers[0] and fused.removals == ()
    layer = fused.layers[1]
    expected = np.zeros(CAMERA.hw, np.uint8)
    expected[:, 24:], expected[:, 24 - OVERLAP : 24] = Origin.FILLED, Origin.REPROJECTED
    np.testing.assert_array_equal(layer.origin, expected)
    np.testing.assert_array_equal(layer.hole, expected == 0)
    for name in ("color", "depth", "confidence"):
        np.testing.assert_array_equal(getattr(layer, name)[~layer.hole], getattr(filled, name)[~layer.hole])
    np.testing.assert_array_equal(contribution(layer), expected == Origin.FILLED)


def test_the_rim_joins_what_was_filled_to_what_it_continues() -> None:
    """Law: seen from aside there is no crack between the two halves of the wall."""
    scene, filled = half_filled()
    aside = moved(CAMERA, (0, -10, 0), (0.7, 0, 0))
    before, after = render(scene, aside), render(fuse(scene, filled), aside)
    seam = np.flatnonzero(before.hole[18] & ~after.hole[18])[0]
    assert not after.hole[4:-4, seam - 2 : seam + 3].any()


def begin_at_first(corners: list[int]) -> tuple[int, ...]:
    """The corners of a triangle in their order, the least number first."""
    first = corners.index(min(corners))
    return (*corners[first:], *corners[:first])


def test_quads_are_cut_as_rendering_cuts_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twin of rendering, of random depth and joints; all counter-clockwise in the picture, where the twin's are clockwise."""
    rng = np.random.default_rng(0)
    depth, joined = rng.uniform(1, 3, (9, 12)).astype(np.float32), rng.integers(0, 4, (9, 12), np.uint8)
    joined[rng.random(joined.shape) < 0.6] = 3
    monkeypatch.setattr(fusion, "mesh_grid", lambda layer: (layer.depth, joined))
    found = layer_mesh(View.from_rgbd(rgbd_of(depth))).triangles[:, ::-1].tolist()
    right, down = (joined[:, :-1] & 1) > 0, (joined[:-1] & 2) > 0
    expected = [[12 * row + column for row, column in one] for one in triangles_of(right, down, 1 / depth)]
    assert sorted(map(begin_at_first, found)) == sorted(map(begin_at_first, expected))


def test_the_mesh_of_a_wall() -> None:
    """Closed form: two triangles a quad, normals to the camera, every vertex on the wall, colours and origins the pixels'."""
    frame = frame_of(WALL)
    mesh = scene_mesh(Scene((View.from_rgbd(frame),)))
    assert len(mesh.triangles) == 2 * 35 * 47
    np.testing.assert_allclose(mesh.vertices, points_of(CAMERA, frame.depth.astype(float)).reshape(-1, 3), atol=1e-9)
    np.testing.assert_array_equal(mesh.color, frame.color.reshape(-1, 3))
    assert (mesh.origin == Origin.MEASURED).all() and (mesh.confidence == 1).all()
    x, y, _ = pixels_of(CAMERA, mesh.vertices[mesh.triangles])
    area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    np.testing.assert_allclose(area, -1, atol=1e-6)
    corners = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    normals = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    assert ((normals * (CAMERA.world_from_cam[:3, 3] - corners[0])).sum(1) > 0).all()


def test_the_mesh_is_cut_between_ball_and_wall_and_has_no_sky() -> None:
    """Closed form: no triangle spans the gap of over a metre; far pixels have no vertices, nor has what was removed."""
    plain = frame_of(WALL, Sphere((0, 0, 2), 0.4))
    depth = plain.depth.copy()
    depth[:3] = np.inf
    source = View.from_rgbd(RGBD(plain.color, depth, CAMERA))
    ball = World((WALL, Sphere((0, 0, 2), 0.4))).trace(CAMERA.at(np.eye(4)))[1] == 1
    scene = Scene((source.without(ball, HoleType.OBJECT),), (source.without(~ball, HoleType.NONE),))
    with_ball, without = scene_mesh(Scene((source,))), scene_mesh(scene)
    for mesh in (with_ball, without):
        assert np.isfinite(mesh.vertices).all()
        edges = mesh.vertices[mesh.triangles] - np.roll(mesh.vertices[mesh.triangles], 1, axis=1)
        assert np.linalg.norm(edges, axis=-1).max() < 0.5
    assert 0 < len(with_ball.vertices) - len(without.vertices) <= ball.sum()
    assert pixels_of(CAMERA, without.vertices)[2].min() > 2.5
    assert len(without.vertices) == (source.valid & ~ball).sum()


def test_a_mesh_names_only_vertices_it_has() -> None:
    """Message: a triangle beyond the last vertex is refused, and so are lengths that do not fit."""
    fields = {
        "vertices": np.zeros((3, 3)),
        "triangles": np.array([[0, 1, 2]], np.int32),
        "color": np.zeros((3, 3), np.uint8),
        "origin": np.zeros(3, np.uint8),
        "confidence": np.zeros(3, np.float32),
    }
    assert not Mesh(**fields).vertices.flags.writeable
    for number in (3, -1):
        with pytest.raises(ShapeError, match=r"outside 0\.\.2"):
            Mesh(**{**fields, "triangles": np.array([[0, 1, number]], np.int32)})
    with pytest.raises(ShapeError, match=r"mesh\.color is uint8 \(2, 3\)"):
        Mesh(**{**fields, "color": np.zeros((2, 3), np.uint8)})
    with pytest.raises(ShapeError, match=r"mesh\.triangles is int64"):
        Mesh(**{**fields, "triangles": np.array([[0, 1, 2]])})


def test_an_empty_mesh_is_a_mesh() -> None:
    """Law: a view of nothing but sky has no vertices and no triangles, and is no error."""
    scene = Scene((View.from_rgbd(rgbd_of(np.full((3, 4), np.inf))),))
    assert len(scene_mesh(scene).vertices) == len(scene_mesh(scene).triangles) == len(scene_cloud(scene)) == 0
