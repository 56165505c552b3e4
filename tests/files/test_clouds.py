"""PLY and GLB: there and back, and as trimesh and plyfile see them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from plyfile import PlyData, PlyElement

from dlama.errors import FileError
from dlama.files.scenes.clouds import read_ply, write_glb, write_ply
from dlama.files.scenes.meshes import linear_light
from dlama.geometry.cloud import PointCloud
from dlama.geometry.mesh import Mesh


def cloud_of(points: np.ndarray) -> PointCloud:
    rng, count = np.random.default_rng(1), len(points)
    return PointCloud(
        np.asarray(points, np.float64).reshape(-1, 3),
        rng.integers(0, 256, (count, 3)).astype(np.uint8),
        rng.integers(0, 5, count).astype(np.uint8),
        rng.random(count).astype(np.float32),
    )


def assert_same(a: PointCloud, b: PointCloud) -> None:
    for name in ("points", "color", "origin", "confidence"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name


@pytest.mark.parametrize("count", [0, 1, 100])
def test_ply_there_and_back(tmp_path: Path, count: int) -> None:
    cloud = cloud_of(np.random.default_rng(0).normal(0, 5, (count, 3)).astype(np.float32))
    write_ply(tmp_path / "c.ply", cloud)
    assert_same(read_ply(tmp_path / "c.ply"), cloud)


def test_far_away_points_keep_their_millimetres(tmp_path: Path) -> None:
    cloud = cloud_of(np.array([[4.2e6, -1.1e6, 12.001], [4.2e6 + 0.001, -1.1e6, 12]]))
    write_ply(tmp_path / "c.ply", cloud)
    assert_same(read_ply(tmp_path / "c.ply"), cloud)


def test_ply_as_others_see_it(tmp_path: Path) -> None:
    """Oracles: plyfile's own reading of the header, and trimesh's points and colours."""
    cloud = cloud_of(np.random.default_rng(0).normal(0, 5, (50, 3)).astype(np.float32))
    write_ply(tmp_path / "c.ply", cloud)
    head = PlyData.read(str(tmp_path / "c.ply"))
    assert not head.text and head.byte_order == "<" and len(head.elements) == 1
    assert [p.name for p in head["vertex"].properties] == [
        "x",
        "y",
        "z",
        "red",
        "green",
        "blue",
        "origin",
        "confidence",
    ]
    assert [p.val_dtype for p in head["vertex"].properties] == ["f4"] * 3 + ["u1"] * 4 + ["f4"]
    seen = trimesh.load(tmp_path / "c.ply")
    assert np.allclose(seen.vertices, cloud.points) and np.array_equal(seen.colors[:, :3], cloud.color)


def test_ply_of_others(tmp_path: Path) -> None:
    """trimesh's file has neither origin nor confidence: measured, 1."""
    cloud = cloud_of(np.random.default_rng(0).normal(0, 5, (9, 3)).astype(np.float32))
    trimesh.PointCloud(cloud.points, cloud.color).export(tmp_path / "t.ply")
    back = read_ply(tmp_path / "t.ply")
    assert np.allclose(back.points, cloud.points) and np.array_equal(back.color, cloud.color)
    assert (back.origin == 1).all() and (back.confidence == 1).all()


def test_bad_ply(tmp_path: Path) -> None:
    bare = np.zeros(4, [("x", "f4"), ("y", "f4"), ("z", "f4")])
    PlyData([PlyElement.describe(bare, "vertex")]).write(str(tmp_path / "bare.ply"))
    PlyData([PlyElement.describe(bare, "face")]).write(str(tmp_path / "face.ply"))
    (tmp_path / "text.ply").write_text("no ply")
    write_ply(tmp_path / "cut.ply", cloud_of(np.ones((30, 3))))
    (tmp_path / "cut.ply").write_bytes((tmp_path / "cut.ply").read_bytes()[:-7])
    for name, words in {
        "bare": "no 'red'",
        "face": "'vertex'",
        "text": "no PLY",
        "cut": "truncated",
        "none": "no such",
    }.items():
        with pytest.raises(FileError, match=words):
            read_ply(tmp_path / f"{name}.ply")


def quad(offset: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    """A square 2 m ahead, wound clockwise as seen (y down), and its vertex data."""
    vertices = np.array([[-1, -1, 2], [1, -1, 2], [-1, 1, 2], [1, 1, 2.0]]) + offset
    return Mesh(
        vertices,
        np.array([[0, 1, 2], [1, 3, 2]], np.int32),
        np.array([[0, 0, 0], [255, 128, 3], [188, 188, 188], [255, 255, 255]], np.uint8),
        np.array([1, 2, 3, 4], np.uint8),
        np.array([1, 0.75, 0.5, 0.25], np.float32),
    )


def test_glb_as_trimesh_sees_it(tmp_path: Path) -> None:
    """Oracle: trimesh; Y up, -Z ahead, fronts towards the camera, `_ORIGIN` and `_CONFIDENCE` as written."""
    mesh = quad()
    write_glb(tmp_path / "m.glb", mesh)
    scene = trimesh.load(tmp_path / "m.glb")
    (seen,) = scene.dump()
    assert np.allclose(seen.vertices, mesh.vertices * [1, -1, -1])
    assert np.allclose(seen.face_normals, [0, 0, 1])
    attributes = scene.geometry[next(iter(scene.geometry))].vertex_attributes
    assert np.array_equal(np.ravel(attributes["_ORIGIN"]), mesh.origin)
    assert np.array_equal(np.ravel(attributes["_CONFIDENCE"]), mesh.confidence)


def test_glb_is_sound_gltf(tmp_path: Path) -> None:
    """Oracle: the glTF 2.0 text: alignment to 4 bytes, buffers as long as said, linear colours, unlit, two-sided."""
    from pygltflib import GLTF2

    write_glb(tmp_path / "m.glb", quad())
    document = GLTF2().load(str(tmp_path / "m.glb"))
    assert document.extensionsUsed == ["KHR_materials_unlit"]
    assert document.materials[0].doubleSided and "KHR_materials_unlit" in document.materials[0].extensions
    blob = document.binary_blob()
    for view in document.bufferViews:
        assert view.byteOffset % 4 == 0 and view.byteOffset + view.byteLength <= document.buffers[0].byteLength <= len(
            blob
        )
        assert view.byteStride is None or view.byteStride % 4 == 0
    color = document.accessors[document.meshes[0].primitives[0].attributes.COLOR_0]
    view = document.bufferViews[color.bufferView]
    values = np.frombuffer(blob, "<u2", color.count * 4, view.byteOffset).reshape(-1, 4)
    assert color.normalized and color.type == "VEC4" and np.array_equal(values, linear_light(quad().color))


def test_linear_light() -> None:
    """Oracle: IEC 61966-2-1: black, white, and middle grey 188 = 0.5029 of the light; up to level 10 a straight line through
    black, of slope 1 / 12.92, then the power law; monotone, so nothing is lost."""
    grey = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    light = linear_light(grey)
    assert light[0].tolist() == [0, 0, 0, 65535] and light[255, 0] == 65535
    assert light[188, 0] / 65535 == pytest.approx(0.5029, abs=1e-4) and (np.diff(light[:, 0].astype(int)) > 0).all()
    np.testing.assert_allclose(light[:11, 0] / 65535, np.arange(11) / 255 / 12.92, atol=1e-5)
    assert light[11, 0] / 65535 == pytest.approx(((11 / 255 + 0.055) / 1.055) ** 2.4, abs=1e-5)


def test_far_away_mesh_keeps_its_millimetres(tmp_path: Path) -> None:
    mesh = quad((4.2e6, -1.1e6, 3.3e5))
    write_glb(tmp_path / "m.glb", mesh)
    (seen,) = trimesh.load(tmp_path / "m.glb").dump()
    assert np.abs(seen.vertices - mesh.vertices * [1, -1, -1]).max() < 1e-4


def test_meshes_without_triangles(tmp_path: Path) -> None:
    """Vertices alone are points, nothing at all an empty scene."""
    mesh, none = quad(), np.zeros((0, 3), np.int32)
    write_glb(tmp_path / "p.glb", Mesh(mesh.vertices, none, mesh.color, mesh.origin, mesh.confidence))
    (points,) = trimesh.load(tmp_path / "p.glb").dump()
    assert isinstance(points, trimesh.PointCloud) and np.allclose(points.vertices, mesh.vertices * [1, -1, -1])
    empty = Mesh(mesh.vertices[:0], none, mesh.color[:0], mesh.origin[:0], mesh.confidence[:0])
    write_glb(tmp_path / "e.glb", empty)
    assert (tmp_path / "e.glb").read_bytes()[:4] == b"glTF"
