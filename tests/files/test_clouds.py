"""PLY: there and back, and as plyfile sees it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from plyfile import PlyData, PlyElement

from dlama.errors import FileError
from dlama.files.scenes.clouds import read_ply, write_ply
from dlama.geometry.cloud import PointCloud


def cloud_of(points: np.ndarray) -> PointCloud:
    rng, count = np.random.default_rng(1), len(points)
    color, origin = rng.integers(0, 256, (count, 3), np.uint8), rng.integers(0, 5, count, np.uint8)
    return PointCloud(points.astype(np.float64), color, origin, rng.random(count, np.float32))


def assert_same(a: PointCloud, b: PointCloud) -> None:
    for name in ("points", "color", "origin", "confidence"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name


POINTS = np.random.default_rng(0).normal(0, 5, (100, 3)).astype(np.float32)
FAR_AWAY = np.array([[4.2e6, -1.1e6, 12.001], [4.2e6 + 0.001, -1.1e6, 12]])
"""They keep their millimetres."""


@pytest.mark.parametrize("points", [*(POINTS[:count] for count in (0, 1, 100)), FAR_AWAY])
def test_ply_there_and_back(tmp_path: Path, points: np.ndarray) -> None:
    cloud = cloud_of(points)
    write_ply(tmp_path / "c.ply", cloud)
    assert_same(read_ply(tmp_path / "c.ply"), cloud)


def test_ply_as_others_see_it(tmp_path: Path) -> None:
    """Oracles: plyfile's own reading of the header, and trimesh's points and colours."""
    cloud = cloud_of(POINTS[:50])
    write_ply(tmp_path / "c.ply", cloud)
    head = PlyData.read(str(tmp_path / "c.ply"))
    assert not head.text and head.byte_order == "<" and len(head.elements) == 1
    assert [p.name for p in head["vertex"].properties] == [*"xyz", "red", "green", "blue", "origin", "confidence"]
    assert [p.val_dtype for p in head["vertex"].properties] == ["f4"] * 3 + ["u1"] * 4 + ["f4"]
    seen = trimesh.load(tmp_path / "c.ply")
    assert np.allclose(seen.vertices, cloud.points) and np.array_equal(seen.colors[:, :3], cloud.color)


def test_ply_of_others(tmp_path: Path) -> None:
    """trimesh's file has neither origin nor confidence: measured, 1."""
    cloud = cloud_of(POINTS[:9])
    trimesh.PointCloud(cloud.points, cloud.color).export(tmp_path / "t.ply")
    back = read_ply(tmp_path / "t.ply")
    assert np.allclose(back.points, cloud.points) and np.array_equal(back.color, cloud.color)
    assert (back.origin == 1).all() and (back.confidence == 1).all()


@pytest.mark.parametrize("values", [(99, 200, "u1"), (-3.5, np.nan, "f4")])
def test_what_others_call_origin_and_confidence_is_not_ours(tmp_path: Path, values: tuple[float, float, str]) -> None:
    """Closed form: numbers that are no code and no share of 1, as Metashape's confidence of 0 to 255: measured, 1."""
    origin, confidence, kind = values
    names = [(name, "f4") for name in "xyz"] + [(name, "u1") for name in ("red", "green", "blue")]
    vertex = np.zeros(4, [*names, ("origin", kind), ("confidence", kind)])
    vertex["origin"], vertex["confidence"] = origin, confidence
    PlyData([PlyElement.describe(vertex, "vertex")]).write(str(tmp_path / "other.ply"))
    back = read_ply(tmp_path / "other.ply")
    assert (back.origin == 1).all() and (back.confidence == 1).all()


def test_bad_ply(tmp_path: Path) -> None:
    bare = np.zeros(4, [("x", "f4"), ("y", "f4"), ("z", "f4")])
    PlyData([PlyElement.describe(bare, "vertex")]).write(str(tmp_path / "bare.ply"))
    PlyData([PlyElement.describe(bare, "face")]).write(str(tmp_path / "face.ply"))
    (tmp_path / "text.ply").write_text("no ply")
    head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar float x\nproperty float y\nproperty float z\n"
    colors = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    (tmp_path / "list.ply").write_text(f"{head}{colors}end_header\n2 1 2 0 0 9 9 9\n")
    write_ply(tmp_path / "cut.ply", cloud_of(np.ones((30, 3))))
    (tmp_path / "cut.ply").write_bytes((tmp_path / "cut.ply").read_bytes()[:-7])
    words_of = {"bare": "no 'red'", "face": "'vertex'", "text": "no PLY", "cut": "truncated", "none": "no such"}
    for name, words in {**words_of, "list": "'x' of the vertices is a list"}.items():
        with pytest.raises(FileError, match=words):
            read_ply(tmp_path / f"{name}.ply")
