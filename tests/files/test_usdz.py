"""USDZ files of 3-D photos (oracles: OpenUSD's own reader and validators; the parts that were written)."""

from __future__ import annotations

import io
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pxr import Usd, UsdGeom, UsdValidation

from dlama.errors import MissingExtraError
from dlama.files.scenes.usdz import write_usdz
from dlama.geometry.cloud import Mesh
from dlama.geometry.layers.layered_mesh import MeshPart


def part(x: float, channels: int) -> MeshPart:
    """A quad at that x, five metres off, with a picture of 4 x 2 pixels that is bright at the top."""
    corners = np.array([[x, 0, 5], [x + 1, 0, 5], [x + 1, 1, 5], [x, 1, 5]], np.float64)
    triangles, color = np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros((4, 3), np.uint8)
    mesh = Mesh(corners, triangles, color, np.ones(4, np.uint8), np.ones(4, np.float32))
    picture = np.zeros((2, 4, channels), np.uint8)
    picture[0] = 255
    return MeshPart(mesh, np.array([[0, 0], [4, 0], [4, 2], [0, 2]], np.float64), picture, None)


def test_what_is_read_back_is_what_was_written(tmp_path: Path) -> None:
    """Oracle: OpenUSD reads points in metres from the camera, y up, triangles counter-clockwise in front, texture coordinates
    with v up, and its validators find nothing; the soft part is a mesh of its own whose picture has alpha."""
    parts = [part(0, 3), part(3, 4)]
    write_usdz(tmp_path / "photo.usdz", parts)
    stage = Usd.Stage.Open(str(tmp_path / "photo.usdz"))
    assert UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1
    for name, one in zip(("opaque", "soft1"), parts):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/photo/{name}"))
        world = UsdGeom.XformCache().GetLocalToWorldTransform(mesh.GetPrim())
        points = [tuple(world.Transform(point)) for point in mesh.GetPointsAttr().Get()]
        np.testing.assert_allclose(points, one.mesh.vertices * (1, -1, -1), atol=1e-6)
        uv = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get())
        np.testing.assert_allclose(uv, [[0, 1], [1, 1], [1, 0], [0, 0]], atol=1e-6)
        assert np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3).tolist() == one.mesh.triangles.tolist()
    registry = UsdValidation.ValidationRegistry()
    found = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(stage)
    assert [error.GetMessage() for error in found] == []
    with zipfile.ZipFile(tmp_path / "photo.usdz") as archive:
        pictures = {name: Image.open(io.BytesIO(archive.read(name))) for name in archive.namelist()[1:]}
    assert {name: one.mode for name, one in pictures.items()} == {"opaque.jpg": "RGB", "soft1.png": "RGBA"}


def test_colours_do_not_run_into_their_neighbours(tmp_path: Path) -> None:
    """Oracle: the picture, red next to green as at an object's edge; a JPEG of half the chroma is 56 levels off there."""
    picture = np.zeros((16, 16, 3), np.uint8)
    picture[:, :7, 0], picture[:, 7:, 1] = 200, 200
    write_usdz(tmp_path / "photo.usdz", [part(0, 3)._replace(picture=picture)])
    with zipfile.ZipFile(tmp_path / "photo.usdz") as archive:
        found = np.array(Image.open(io.BytesIO(archive.read("opaque.jpg"))), int)
    assert np.abs(found - picture).mean(axis=(0, 2)).max() < 12


def test_without_the_package_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The extra by name, and no file."""
    for name in ("pxr", "pxr.Usd"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingExtraError, match=r"a USDZ file needs .* 'usd-core': pip install 'dlama\[usd\]'"):
        write_usdz(tmp_path / "photo.usdz", [part(0, 3)])
    assert list(tmp_path.iterdir()) == []
