"""A scene as a textured GLB.

Oracles: pygltflib, which has the document as it is; trimesh, which reads the texture at each vertex; glTF 2.0, sec. 3.6.2.4.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pygltflib import GLTF2

from box_frame import CAMERA, WORLD
from dlama.completion.verbs import remove, view
from dlama.files.scenes import textured_mesh
from dlama.files.scenes.textured_mesh import bring_near, pack_textures, write_textured_glb
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import Mesh, join_meshes
from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.layers.decimation import decimate
from dlama.geometry.layers.layered_mesh import MeshPart
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

SCENE = remove(WORLD.rgbd(CAMERA), WORLD.trace(CAMERA)[1] == 1, yaw=15, filler="telea").scene
FLOAT, VERTICES = 5126, 34962
"""Kind of an accessor's numbers; target of a buffer view that holds vertex attributes."""


def on_axes(mesh: Mesh) -> np.ndarray:
    """Positions with glTF's axes: y up, z towards the viewer."""
    return np.asarray(mesh.vertices) * [1, -1, -1]


def decimated(layers: Sequence[View]) -> Mesh:
    """What is expected in the file."""
    return join_meshes([decimate(layer).mesh for layer in layers])


def assert_colors_near(found: np.ndarray, expected: np.ndarray) -> None:
    """As near as the JPEG of a rough texture is: 3 levels on average, 40 at most."""
    off = np.abs(found.astype(int) - expected)
    assert off.mean() < 3 and off.max() <= 40


def corners_of(file: Path) -> np.ndarray:
    """Position, place in the texture, origin and confidence of each triangle's corners, triangles in one order."""
    seen = trimesh.load(file, process=False, force="mesh")
    about = seen.vertex_attributes
    planes = (seen.vertices, seen.visual.uv, about["_ORIGIN"].reshape(-1, 1), about["_CONFIDENCE"].reshape(-1, 1))
    found = np.concatenate(planes, 1)[seen.faces].reshape(len(seen.faces), -1)
    return np.asarray(found[np.lexsort(found.T)])


def test_the_texture_is_the_picture(tmp_path: Path) -> None:
    """Each vertex reads its own colour, as JPEG keeps it, in the middle of a texel; all else is the decimated mesh's."""
    write_textured_glb(tmp_path / "scene.glb", SCENE)
    document, mesh = GLTF2().load(str(tmp_path / "scene.glb")), decimated(SCENE.layers)
    (one,), (material,) = document.meshes[0].primitives, document.materials
    assert material.extensions == {"KHR_materials_unlit": {}} and "KHR_materials_unlit" in document.extensionsUsed
    assert one.attributes.COLOR_0 is None and material.pbrMetallicRoughness.baseColorFactor == [1, 1, 1, 1]
    assert all(view.byteStride % 4 == 0 for view in document.bufferViews if view.target == VERTICES)  # sec. 3.6.2.4
    for name in ("_ORIGIN", "_CONFIDENCE"):  # Blender 5.0's importer takes single numbers as floats only
        assert document.accessors[getattr(one.attributes, name)].componentType == FLOAT
    seen = trimesh.load(tmp_path / "scene.glb", process=False, force="mesh")
    picture = np.asarray(seen.visual.material.baseColorTexture.convert("RGB"))
    at = (seen.visual.uv * (1, -1) + (0, 1)) * picture.shape[1::-1]  # trimesh's v runs up
    assert np.abs(at % 1 - 0.5).max() < 0.01
    assert_colors_near(picture[at[:, 1].astype(int), at[:, 0].astype(int)], mesh.color)
    np.testing.assert_allclose(seen.vertices, on_axes(mesh), atol=1e-5)
    np.testing.assert_array_equal(seen.vertex_attributes["_ORIGIN"].ravel(), mesh.origin)
    np.testing.assert_array_equal(seen.vertex_attributes["_CONFIDENCE"].ravel(), mesh.confidence)
    np.testing.assert_array_equal(np.sort(seen.faces, 1), np.sort(mesh.triangles, 1))


def test_a_large_mesh_is_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bytes number the vertices of each; all have one picture. Oracle: the same triangles in one piece."""
    write_textured_glb(tmp_path / "whole.glb", SCENE)
    monkeypatch.setattr(textured_mesh, "SHORT_VERTICES", 200)
    write_textured_glb(tmp_path / "scene.glb", SCENE)
    document = GLTF2().load(str(tmp_path / "scene.glb"))
    pieces = document.meshes[0].primitives
    assert len(pieces) > 2 and len(document.images) == len(document.materials) == 1
    assert all(document.accessors[one.attributes.POSITION].count <= 200 for one in pieces)
    assert {document.accessors[one.indices].componentType for one in pieces} == {5123}
    assert np.array_equal(corners_of(tmp_path / "scene.glb"), corners_of(tmp_path / "whole.glb"))


def test_layers_of_other_sizes_and_without_surface(tmp_path: Path) -> None:
    """A layer of sky alone has no vertex and no place in the texture; where nothing has one the scene is empty."""
    small = Camera.from_fov(20, 30, 50)
    sky = View.from_rgbd(RGBD(np.zeros((48, 64, 3), np.uint8), np.full((48, 64), np.inf, np.float32), CAMERA))
    layers = (View.from_rgbd(WORLD.rgbd(CAMERA)), sky, View.from_rgbd(WORLD.rgbd(small)))
    write_textured_glb(tmp_path / "scene.glb", Scene(layers[:2], fills=layers[2:]))
    (seen,) = trimesh.load(tmp_path / "scene.glb", process=False).dump()
    assert_colors_near(seen.visual.to_color().vertex_colors[:, :3], decimated(layers).color)
    write_textured_glb(tmp_path / "empty.glb", Scene((sky,)))
    assert (tmp_path / "empty.glb").read_bytes()[:4] == b"glTF"


def test_rims_are_inside_their_own_picture() -> None:
    """A part whose vertices reach over what is shown of it, beside a black one: all of it is white (oracle: its only colour)."""
    part = decimate(view(WORLD.rgbd(CAMERA), yaw=20, filler="telea").scene.layers[0])
    shown = np.zeros(part.surface.shape, bool)
    shown[20:30, 20:30] = True
    levels = [np.full((*shown.shape, 3), level, np.uint8) for level in (255, 0)]
    white, black = (MeshPart(part.mesh, part.pixels, picture, shown) for picture in levels)
    texture, places = pack_textures((white, black))
    columns, rows = (white.pixels + places[0]).astype(int).T
    assert (texture[rows, columns] == 255).all()


def test_a_tall_texture_is_filled_from_near_rows(monkeypatch):
    """Oracle: all rows at once, by the same distances, where no nearest pixel lies farther than the rows that are looked at."""
    monkeypatch.setattr(textured_mesh, "ROWS", 16)
    rng = np.random.default_rng(3)
    picture, shown = rng.integers(0, 256, (70, 20, 3), np.uint8), rng.random((70, 20)) < 0.3
    out = np.zeros_like(picture)
    textured_mesh.fill_unseen(picture, shown, out)
    np.testing.assert_array_equal(out, fill_with_nearest(picture, shown))


def test_what_is_far_is_drawn_in_along_its_rays() -> None:
    """From the camera nothing moves; order and what is near stay, and nothing is left beyond half as far again."""
    rng, pose = np.random.default_rng(0), np.eye(4)
    pose[:3, 3] = (1, 2, 3)
    rays = rng.normal(size=(200, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    far = np.sort(np.exp(rng.uniform(-2, 8, 200)))
    vertices = pose[:3, 3] + rays * far[:, None]
    kind, sure = np.ones(200, np.uint8), np.ones(200, np.float32)
    plain = Mesh(vertices, np.zeros((0, 3), np.int32), np.zeros((200, 3), np.uint8), kind, sure)
    part = MeshPart(plain, np.zeros((200, 2)), np.zeros((1, 1, 3), np.uint8), None)
    (found,) = bring_near([part], Camera(64, 48, 55.0, 55.0, 32.0, 24.0).at(pose), 10.0)
    moved = found.mesh.vertices - pose[:3, 3]
    distance = np.linalg.norm(moved, axis=1)
    assert np.allclose(moved / distance[:, None], rays) and (np.diff(distance) > 0).all() and distance.max() < 15
    assert (found.mesh.vertices[far < 9.99] == vertices[far < 9.99]).all()


def test_nothing_bleeds_in_at_edges() -> None:
    """A pixel without a vertex has the colour of the nearest that has one, not the hole's black."""
    shown = view(WORLD.rgbd(CAMERA), yaw=20, filler="telea").scene.layers[-1]
    levels = np.where(shown.hole, np.uint8(0), np.uint8(255))
    white = dataclasses.replace(shown, color=np.stack([levels] * 3, axis=2))
    part = MeshPart(decimate(white).mesh, decimate(white).pixels, white.color, ~shown.hole)
    assert (pack_textures((part,))[0] == 255).all()
