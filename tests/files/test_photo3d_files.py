"""The files of a 3-D photo (oracles: trimesh and plyfile, which others wrote; the limits; the scene's own points)."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from PIL import Image
from plyfile import PlyData

import dlama
from box_frame import CAMERA, WORLD
from dlama.completion.photo3d import Photo3D, photo3d
from dlama.errors import InputError
from dlama.files.results import photo3d as module
from dlama.files.results.photo3d import anaglyph, write_photo3d
from dlama.files.scenes.photo3d_page import glb_within
from dlama.files.scenes.splats import FIELDS, SIZE, peak_opacity, scene_splats
from dlama.files.scenes.textured_mesh import pack_parts, shrink_picture, textured_glb
from dlama.geometry.layers.head_box import HeadBox
from dlama.geometry.layers.layered_mesh import mesh_layers
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.progress import show_progress


@pytest.fixture(scope="module")
def photo() -> Photo3D:
    """A box before a wall."""
    return photo3d(WORLD.rgbd(CAMERA), filler="telea")


@pytest.fixture(scope="module")
def folder(photo: Photo3D, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All files but the loop, which another test writes."""
    return write_photo3d(photo, tmp_path_factory.mktemp("p") / "out", also=("splats", "spz", "stereo", "scene"))


def test_the_mesh_opens_elsewhere(folder: Path) -> None:
    """trimesh reads a textured mesh, and its soft borders; it is as small as meta.json says."""
    mesh, soft = trimesh.load(folder / "photo3d.glb", process=False).dump()
    reported = json.loads((folder / "meta.json").read_text())
    triangles = len(mesh.faces) + len(soft.faces)
    assert mesh.visual.kind == "texture" and triangles == reported["files"]["triangles"] <= module.MOST_TRIANGLES
    assert (soft.visual.material.alphaMode, soft.visual.material.baseColorTexture.mode) == ("BLEND", "RGBA")
    assert (folder / "photo3d.glb").stat().st_size < 10e6 and reported["photo3d"]["filled_cameras"]
    assert -mesh.vertices[:, 2].min() > 4  # glTF looks along -z: the wall is at 4 m


def test_the_page_holds_everything(folder: Path) -> None:
    """One file with the mesh in it, no address, no import, no mark of the template left."""
    page = (folder / "photo3d.html").read_text("utf-8")
    assert not re.search(r"https?://|^import |^export |\{\{|src=|@import", page, re.M)
    glb = re.search(r'id="glb">([^<]*)<', page)
    assert glb is not None and base64.b64decode(glb[1])[:4] == b"glTF"
    assert len(page) <= 8e6


def test_soft_borders_that_are_most_of_the_file_are_shrunk(photo: Photo3D) -> None:
    """Oracle: the file with the border at half the size and JPEG of quality 60, not at the least quality; a border of one colour
    keeps it, and vertices their places in it."""
    opaque, soft = pack_parts(mesh_layers(photo.scene, photo.box, module.MOST_TRIANGLES))
    noise = np.random.default_rng(0).integers(0, 256, (300, 400), np.uint8)
    fitted = soft.pixels * (400 / soft.picture.shape[1], 300 / soft.picture.shape[0])
    noisy = soft._replace(picture=np.dstack([noise] * 4), pixels=fitted)
    expected = b"".join(textured_glb([opaque, shrink_picture(noisy, 2)], 60))
    assert glb_within([opaque, noisy], len(expected)) == expected
    planes = [np.full_like(noise, 255), noise * 0, noise * 0, (noise > 128) * np.uint8(255)]
    red = noisy._replace(picture=np.dstack(planes))
    smaller = shrink_picture(red, 4)
    assert smaller.picture.shape == (75, 100, 4) and np.allclose(smaller.pixels * 4, red.pixels)
    assert (smaller.picture[smaller.picture[..., 3] > 0][:, :3] == (255, 0, 0)).all()
    assert abs(float(smaller.picture[..., 3].mean()) - float(red.picture[..., 3].mean())) < 1


def test_splats_lie_where_the_points_do(folder: Path, photo: Photo3D) -> None:
    """In the standard layout: unit rotations, colours of the picture, on the surfaces, a pixel's step in size."""
    vertex = PlyData.read(str(folder / "splats.ply"))["vertex"]
    assert tuple(vertex.data.dtype.names) == FIELDS
    turns = np.stack([vertex[f"rot_{n}"] for n in range(4)], 1)
    assert np.allclose(np.linalg.norm(turns, axis=1), 1, atol=1e-4)
    source = slice(0, int(photo.scene.frames[0].valid.sum()))
    color = np.stack([0.5 + 0.28209479 * vertex[f"f_dc_{n}"] for n in range(3)], 1)[source] * 255
    points = dlama.lift(photo.scene.frames[0])
    at = np.stack([vertex[axis] for axis in "xyz"], 1)[source]
    assert len(at) >= 0.95 * len(points)
    tree = cv2.flann_Index(points.points.astype(np.float32), {"algorithm": 1, "trees": 4})
    nearest, _ = tree.knnSearch(at.astype(np.float32), 1, params={"checks": 64})
    near = np.linalg.norm(points.points[nearest[:, 0]] - at, axis=1) < 1e-3
    assert near.mean() > 0.95 and np.abs(points.color[nearest[:, 0]] - color)[near].mean() < 1
    wall = (np.abs(at[:, 2] - 4) < 1e-3) & near
    step = 4 / CAMERA.fx
    assert np.allclose(np.exp(vertex["scale_0"][source][wall]), SIZE * step, rtol=0.05)
    normals = np.stack([vertex[f"n{axis}"] for axis in "xyz"], 1)[source][wall]
    assert np.allclose(np.abs(normals), (0, 0, 1), atol=1e-3)


@pytest.mark.parametrize("share", [0.1, 0.9])
def test_a_sheet_of_splats_is_as_opaque_as_its_border(share: float) -> None:
    """Drawn one over the other, at random places of a large sheet, splats of the peak hide that share of what is behind."""
    peak, rng = float(peak_opacity(np.array([share]))[0]), np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(-6, 7), np.arange(-6, 7))
    squares = ((x - u) ** 2 + (y - v) ** 2 for u, v in rng.random((99, 2)))
    seen = [1 - np.prod(1 - peak * np.exp(-each / (2 * SIZE**2))) for each in squares]
    assert np.mean(seen) == pytest.approx(share, abs=0.03)


def test_splats_of_soft_borders() -> None:
    """A red box before a blue wall, one column of pixels half of either: its splats are red and half opaque, over blue ones."""
    color, depth = np.zeros((48, 64, 3), np.uint8), np.full((48, 64), 4, np.float32)
    color[...], color[:, :32], color[:, 32] = (20, 20, 200), (200, 20, 20), (110, 20, 110)
    depth[:, :33] = 2
    source = View.from_rgbd(RGBD(color, depth, CAMERA))
    found = dict(zip(FIELDS, scene_splats(Scene((source,)), HeadBox.of(source, 5, 0)).T))
    red, blue = (0.5 + 0.28209479 * found[f"f_dc_{channel}"] for channel in (0, 2))
    share = 1 / (1 + np.exp(-found["opacity"]))
    column = found["x"] / found["z"] * CAMERA.fx + CAMERA.cx
    here = (column > 32) & (column < 33)
    front, back = here & (found["z"] < 3), here & (found["z"] > 3)
    assert front.sum() == back.sum() == 48
    assert np.allclose(share[front], peak_opacity(np.array([0.5])), atol=0.05) and np.allclose(share[back], 0.98)
    assert (red[front] > 0.7).all() and (blue[front] < 0.2).all() and (blue[back] > 0.7).all()


def test_stereo_pictures(folder: Path, photo: Photo3D) -> None:
    """Two views side by side, of which the left one sees the box further to the right; red from the left, the rest right."""
    both = cv2.imread(str(folder / "side_by_side.jpg"))
    assert both.shape == (48, 128, 3)
    ours, theirs = np.full((2, 2, 3), 90, np.uint8), np.full((2, 2, 3), 10, np.uint8)
    assert (anaglyph(ours, theirs) == (90, 10, 10)).all()
    left, right = (dlama.render(photo.scene, photo.box.at(side, 0, 0)) for side in (-0.2, 0.2))
    assert np.nonzero(left.depth < 3)[1].mean() > np.nonzero(right.depth < 3)[1].mean()


def test_borders_are_smooth() -> None:
    """A red box before a blue wall, seen from half a pixel aside: the pixels of its borders are half of either."""
    color, depth = np.zeros((48, 64, 3), np.uint8), np.full((48, 64), 4, np.float32)
    color[...], color[12:36, 16:48], depth[12:36, 16:48] = (20, 20, 200), (200, 20, 20), 2
    pose = np.array(CAMERA.world_from_cam)
    pose[0, 3] += 2 * 0.5 / CAMERA.fx
    moved = CAMERA.at(pose)
    seen = module.draw_smooth(Scene((View.from_rgbd(RGBD(color, depth, CAMERA)),)), moved)
    assert (np.abs(seen[14:34, 15].astype(int) - (110, 20, 110)) <= 3).all()
    assert (np.abs(seen[14:34, 17:46].astype(int) - (200, 20, 20)) <= 1).all()


def test_open_pixels_are_not_black() -> None:
    """Oracle: a scene of one colour, in which nothing is filled, is drawn in that colour from elsewhere."""
    seen = WORLD.rgbd(CAMERA)
    scene = dlama.scene([RGBD(np.full_like(seen.color, 200), seen.depth, CAMERA)])
    assert np.all(module.draw_smooth(scene, dlama.orbit(CAMERA, 8, pivot=3)) == 200)


def test_the_loop_ends_where_it_begins(photo: Photo3D, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As many pictures as are said, of the picture's size, each of them a stage, drawn once for both files."""
    monkeypatch.setattr(module, "LOOP_PICTURES", 6)
    stages = list[str]()
    with show_progress(stages.append):
        write_photo3d(photo, tmp_path / "out", only=("loop",))
    assert [name for name in stages if "draw" in name] == [f"draw picture {n} of 6 of the loop" for n in range(1, 7)]
    video = cv2.VideoCapture(str(tmp_path / "out" / "loop.mp4"))
    assert int(video.get(cv2.CAP_PROP_FRAME_COUNT)) == 6 and int(video.get(cv2.CAP_PROP_FRAME_WIDTH)) == 64
    with Image.open(tmp_path / "out" / "loop.webp") as picture:
        assert picture.n_frames == 6
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["loop.mp4", "loop.webp", "meta.json"]


def test_unknown_names_are_refused(photo: Photo3D, tmp_path: Path) -> None:
    """Before anything is written."""
    with pytest.raises(InputError, match=r"'obj'.*page, mesh"):
        write_photo3d(photo, tmp_path / "out", also=("obj",))
    assert list(tmp_path.iterdir()) == []
