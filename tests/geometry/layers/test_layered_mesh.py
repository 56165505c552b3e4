"""Layered meshes (oracles: depth on both sides of every triangle, where rays meet a sphere, the counts)."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dlama.completion.photo3d import Photo3D, photo3d
from dlama.completion.verbs import remove
from dlama.geometry.camera import Camera
from dlama.geometry.codes import Origin
from dlama.geometry.layers.head_box import HeadBox
from dlama.geometry.layers.layered_mesh import MeshPart, depth_of_sphere, fill_own_holes, mesh_layers
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.projection import project, rays
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import contribution
from dlama.geometry.view import View
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(96, 72, 65)
WORLD = World((Plane((0, 0, 6), (0, 0, -1)), Box((-0.5, -0.4, 2), (0.4, 0.5, 2.4))))


@pytest.fixture(scope="module")
def photo() -> Photo3D:
    """A box before a wall, sky above."""
    given = WORLD.rgbd(CAMERA)
    depth = given.depth.copy()
    depth[:10] = np.inf
    return photo3d(RGBD(given.color, depth, CAMERA), filler="telea")


@pytest.fixture(scope="module")
def parts(photo: Photo3D) -> list[MeshPart]:
    """Its layers as a mesh."""
    return mesh_layers(photo.scene, photo.box, 100_000)


def test_no_triangle_spans_a_depth_edge(parts: list[MeshPart], photo: Photo3D) -> None:
    """The box lies at 2 to 2.4 m, the wall at 6, the sky beyond: each triangle of the source on one of them."""
    corners = project(parts[0].mesh.vertices, photo.box.camera)[1][parts[0].mesh.triangles]
    surface = np.searchsorted([4.0, 8.0], corners)
    assert (surface == surface[:, :1]).all() and set(surface.ravel()) == {0, 1, 2}


def test_the_picture_is_where_its_pixels_are(parts: list[MeshPart], photo: Photo3D) -> None:
    """At home each vertex of the source lands on the pixel whose colour it has."""
    assert np.allclose(project(parts[0].mesh.vertices, photo.box.camera)[0], parts[0].pixels, atol=1e-3)
    assert parts[0].shown is None and parts[0].picture.shape == photo.scene.frames[0].color.shape


def test_fills_lie_behind_what_they_join(photo: Photo3D, parts: list[MeshPart]) -> None:
    """What a fill shows again of the box and of the wall is behind them."""
    again = [part.mesh.vertices[part.mesh.origin == Origin.REPROJECTED] for part in parts[1:]]
    depth = project(np.concatenate(again), photo.box.camera)[1]
    assert len(depth) > 20 and depth.min() > 2 and not ((depth > 5.9) & (depth < 6.0)).any()


@pytest.mark.parametrize("place", [(1, 1, -1), (-1, 1, 0), (0.5, -0.5, 1)])
def test_no_gap_opens_between_large_triangles(photo: Photo3D, place: tuple[float, float, float]) -> None:
    """From the ends of the box triangles cover every pixel, of however few they are (oracle: OpenCV's polygons)."""
    camera = photo.box.at(*place)
    covered = np.zeros(camera.hw, np.uint8)
    for part in mesh_layers(photo.scene, photo.box, 4000)[:-1]:
        for corners in project(part.mesh.vertices, camera)[0][part.mesh.triangles]:
            cv2.fillConvexPoly(covered, np.rint(corners * 16 - 8).astype(np.int32), 1, shift=4)
    assert covered.all()


def test_the_backdrop_hides_nothing(photo: Photo3D, parts: list[MeshPart]) -> None:
    """At home it is behind all that is seen round each of its vertices (oracle: the rendered depth)."""
    pixels, depth = project(parts[-2].mesh.vertices, photo.box.camera)
    seen = render(photo.scene, photo.box.camera, types=False).depth
    columns, rows = np.floor(pixels).astype(int).T
    inside = (columns >= 0) & (columns < 96) & (rows >= 0) & (rows < 72)
    shown = seen[rows[inside], columns[inside]]
    assert inside.sum() > 100 and (depth[inside] > np.where(np.isinf(shown), 8, shown)).all()


def test_few_triangles_where_few_are_asked_for(photo: Photo3D) -> None:
    """Coarser, but no more than that."""
    few = mesh_layers(photo.scene, photo.box, 1000)
    assert 0 < sum(len(part.mesh.triangles) for part in few) <= 1000
    *source, backdrop, soft = mesh_layers(photo.scene, photo.box, 100)  # the backdrop alone has more: this had no end
    assert sum(len(part.mesh.triangles) for part in (*source, soft)) <= 50 < 100 < len(backdrop.mesh.triangles)


def test_the_sky_is_a_sphere() -> None:
    """Seen from another camera, its points are all as far from the first one."""
    turned = orbit(CAMERA, 20, 5, 3)
    depth = depth_of_sphere(turned, CAMERA, 50.0)
    points = (rays(turned) * depth[..., None]) @ turned.world_from_cam[:3, :3].T + turned.world_from_cam[:3, 3]
    assert np.allclose(np.linalg.norm(points, axis=2), 50, rtol=1e-5)


def test_a_removed_object_leaves_no_seam() -> None:
    """The box removed: the source is whole, all its triangles lie where the wall is, and no other layer has these pixels."""
    given = WORLD.rgbd(CAMERA)
    mask = given.depth < 4
    done = remove(given, mask, filler="telea", dilate=2)
    source, others = fill_own_holes(done.scene, CAMERA)
    assert not source.hole.any()
    np.testing.assert_array_equal(source.color, done.view.color)
    np.testing.assert_array_equal(source.depth, done.view.depth)
    assert not any(contribution(layer.load())[mask].any() for layer in others if layer.camera.same_view_as(CAMERA))
    found = mesh_layers(done.scene, HeadBox.of(View.from_rgbd(given), angle=3), 100_000)
    assert len(found) == 2 + len(others) + 2 and project(found[0].mesh.vertices, CAMERA)[1].min() > 5.5
