"""Fusion: what a filled view adds to a scene, and the scene as one cloud and one mesh."""

from __future__ import annotations

import dataclasses
import itertools

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
from worlds import Box, Plane, Sphere, World, moved, pixels_of, points_of

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


def ball_removed() -> tuple[Scene, RGBD, np.ndarray]:
    """A ball before a wall, with a strip of sky and a sensor hole: fused after filling, all through the public verbs."""
    plain = frame_of(WALL, Sphere((0, 0, 2), 0.4))
    depth = plain.depth.copy()
    depth[:3], depth[30:33, 5:9] = np.inf, 0
    frame = RGBD(plain.color, depth, CAMERA)
    source = View.from_rgbd(frame)
    taken = World((WALL, Sphere((0, 0, 2), 0.4))).trace(CAMERA.at(np.eye(4)))[1] == 1
    thing = source.without(~taken, HoleType.NONE)
    scene = Scene((source.without(taken, HoleType.OBJECT),), (thing,))
    filled, _ = inpaint(scene.layers[0], find_filler("layered"), FillContext.of(scene))
    background = filled.without(filled.filled, HoleType.OBJECT)
    return fuse(dataclasses.replace(scene, frames=(background,)), filled), frame, taken


def joined_quad(joints: tuple[bool, bool, bool, bool], monkeypatch: pytest.MonkeyPatch) -> Mesh:
    """The mesh of 2 x 2 pixels at 2 m whose (top, left, right, lower) sides are joined as told."""
    top, left, side, bottom = joints
    flags = np.array([[top | left << 1, side << 1], [bottom, 0]], np.uint8)
    view = View.from_rgbd(
        RGBD(np.zeros((2, 2, 3), np.uint8), np.full((2, 2), 2, np.float32), Camera.from_fov(2, 2, 60))
    )
    monkeypatch.setattr(fusion, "mesh_grid", lambda layer: (layer.depth, flags))
    return layer_mesh(view)


def covered(corners: list[tuple[int, int, int]], vertices: np.ndarray) -> np.ndarray:
    """Which of 400 places in the quad lie in one of the triangles (inside, counter-clockwise on the screen)."""
    u, v = np.meshgrid((np.arange(20) + 0.41) / 20, (np.arange(20) + 0.53) / 20)
    out = np.zeros(u.shape, bool)
    for triangle in corners:
        p = vertices[list(triangle)]
        sides = [
            (p[(k + 1) % 3, 0] - p[k, 0]) * (v - p[k, 1]) - (p[(k + 1) % 3, 1] - p[k, 1]) * (u - p[k, 0])
            for k in range(3)
        ]
        out |= (np.array(sides) < 0).all(0)
    return out


@pytest.mark.parametrize(
    "joints",
    list(itertools.product((False, True), repeat=4)),
    ids=lambda j: "".join(name if on else "-" for name, on in zip("tlrb", j)),
)
def test_a_quad_is_cut_as_rendering_cuts_it(joints: tuple[bool, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Literal rule of rendering: two triangles where all four sides are joined, else the triangle of each corner whose two
    sides are; compared by the area covered, all counter-clockwise on the screen."""
    top, left, side, bottom = joints
    square = np.array([(0, 0), (1, 0), (0, 1), (1, 1)], float)
    wanted = [
        (top and left, (0, 2, 1)),
        (side and bottom, (1, 2, 3)),
        (top and side, (0, 3, 1)),
        (left and bottom, (0, 2, 3)),
    ]
    mesh = joined_quad((top, left, side, bottom), monkeypatch)
    assert len(mesh.vertices) == 4
    got = covered([tuple(t) for t in mesh.triangles.tolist()], square)
    np.testing.assert_array_equal(got, covered([corner for on, corner in wanted if on], square))


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
    """Closed form: no triangle spans the gap of over a metre; far pixels have no vertices; nor has the object."""
    scene, frame, taken = ball_removed()
    without, ball = scene_mesh(scene), scene_mesh(Scene(scene.removals))
    with_ball = scene_mesh(Scene((View.from_rgbd(frame),)))
    for mesh in (with_ball, without):
        assert np.isfinite(mesh.vertices).all()
        edges = mesh.vertices[mesh.triangles] - np.roll(mesh.vertices[mesh.triangles], 1, axis=1)
        assert np.linalg.norm(edges, axis=-1).max() < 0.5
    assert 0 < len(ball.vertices) <= taken.sum()
    z = pixels_of(CAMERA, without.vertices)[2]
    assert z.min() > 2.5
    assert len(without.vertices) >= (frame.valid & ~taken).sum()


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
    view = View.from_rgbd(
        RGBD(np.zeros((3, 4, 3), np.uint8), np.full((3, 4), np.inf, np.float32), Camera.from_fov(4, 3, 60))
    )
    mesh = scene_mesh(Scene((view,)))
    assert len(mesh.vertices) == len(mesh.triangles) == 0
    assert len(scene_cloud(Scene((view,)))) == 0
