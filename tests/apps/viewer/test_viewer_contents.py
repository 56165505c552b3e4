"""What `dlama show` shows (oracles: the layers of the scene that was written, closed forms of paths)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import dlama
from dlama.apps.viewer import contents, server
from dlama.apps.viewer.cameras import camera_on_path
from dlama.files.scenes.clouds import read_ply, write_ply
from dlama.files.scenes.scene_npz import read_npz
from dlama.geometry.cloud import PointCloud
from dlama.geometry.figures.false_color import ORIGIN_PALETTE


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A removal's results, scene and points."""
    folder = dlama.example()
    street = dlama.read_rgbd(folder / "street.jpg", folder / "depth.png", fov=90)
    done = dlama.remove(street, dlama.read_mask(folder / "mask.png"), filler="telea")
    out = tmp_path_factory.mktemp("shown") / "out"
    dlama.write(done, out, only=("scene", "points"))
    return out


def test_a_scene_is_told_apart_by_origin(results: Path) -> None:
    """Measured and filled points are those of the completed background; the object has its own name."""
    shown = contents.contents_of(results)
    _, scene = read_npz(results / "scene.npz")
    assert list(shown.clouds) == ["measured", "filled", "removed object"]
    in_all = len(shown.clouds["measured"]) + len(shown.clouds["filled"])
    assert in_all == len(read_ply(results / "background.ply"))
    assert set(np.unique(shown.clouds["filled"].origin)) <= {dlama.Origin.FILLED, dlama.Origin.DEPTH_FILLED}
    assert set(np.unique(shown.clouds["measured"].origin)) == {dlama.Origin.MEASURED}
    assert len(shown.clouds["removed object"]) == int(scene.removals[0].valid.sum())
    assert [frame.camera.wh for frame in shown.frames] == [(512, 512)]
    assert contents.contents_of(results / "scene.npz").clouds.keys() == shown.clouds.keys()


def test_a_ply_is_told_apart_too(results: Path) -> None:
    ply = next(results.glob("*.ply"))
    shown = contents.contents_of(ply)
    assert "measured" in shown.clouds and not shown.frames and shown.scene is None


def test_what_another_frame_saw_is_measured(tmp_path: Path) -> None:
    """Law: ELSEWHERE is measured, by another frame than the one whose view it fills; it was shown as filled."""
    write_ply(tmp_path / "seen.ply", cloud(4, dlama.Origin.ELSEWHERE))
    assert list(contents.contents_of(tmp_path / "seen.ply").clouds) == ["measured"]


def test_what_cannot_be_shown_is_said(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(dlama.FileError, match="no such file or folder"):
        contents.contents_of(tmp_path / "none.npz")
    with pytest.raises(dlama.InputError, match=r"notes\.txt: is a \.txt file; a scene\.npz, a \.ply or a folder"):
        contents.contents_of(tmp_path / "notes.txt")
    (tmp_path / "notes").write_text("x")
    with pytest.raises(dlama.InputError, match="notes: is a file without an ending; a scene"):
        contents.contents_of(tmp_path / "notes")
    with pytest.raises(dlama.InputError, match="no data set of a known layout"):
        contents.contents_of(tmp_path)


def cloud(count: int, origin: int = 1, confidence: float = 1) -> PointCloud:
    return PointCloud(
        np.arange(3.0 * count).reshape(count, 3),
        np.zeros((count, 3), np.uint8),
        np.full(count, origin, np.uint8),
        np.full(count, confidence, np.float32),
    )


def test_many_points_are_thinned_alike_and_the_same_each_time() -> None:
    clouds = {"measured": cloud(8000), "filled": cloud(2000)}
    thin = contents.sample_points(clouds, 1000)
    assert {name: len(each) for name, each in thin.items()} == {"measured": 800, "filled": 200}
    assert (thin["measured"].points == contents.sample_points(clouds, 1000)["measured"].points).all()
    assert contents.sample_points(clouds, 10_000) is clouds


def test_colours_by_origin_and_confidence() -> None:
    assert tuple(contents.colors(cloud(1, dlama.Origin.FILLED), "origin")[0]) == ORIGIN_PALETTE[dlama.Origin.FILLED]
    assert tuple(contents.colors(cloud(1, confidence=0), "confidence")[0]) == contents.LOW
    assert tuple(contents.colors(cloud(1, confidence=1), "confidence")[0]) == contents.HIGH


def test_a_path_goes_through_its_cameras_and_turns_evenly() -> None:
    """Oracles: on a straight line at even distances the spline is the line; half of a turn by 60 degrees is 30."""
    start = dlama.Camera.from_fov(64, 48, 60)
    cameras = [shifted(dlama.orbit(start, yaw, pivot=0), x) for x, yaw in ((0, 0), (2, 60), (4, 60))]
    for number, camera in enumerate(cameras):
        assert np.allclose(camera_on_path(cameras, number).world_from_cam, camera.world_from_cam, atol=1e-9)
    half = camera_on_path(cameras, 0.5).world_from_cam
    assert np.allclose(half[:3, :3], dlama.orbit(start, 30, pivot=0).world_from_cam[:3, :3], atol=1e-9)
    straight = [shifted(start, x) for x in (0, 2, 4, 6)]
    assert np.allclose(camera_on_path(straight, 1.25).world_from_cam[:3, 3], (2.5, 0, 0), atol=1e-9)
    assert np.allclose(camera_on_path(cameras[:1], 0.7).world_from_cam, cameras[0].world_from_cam)


def shifted(camera: dlama.Camera, x: float) -> dlama.Camera:
    """The camera with its centre at x metres to the right."""
    pose = camera.world_from_cam.copy()
    pose[0, 3] = x
    return camera.at(pose)


def test_without_viser_the_pip_line_is_said(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(dlama.MissingExtraError, match=r"pip install 'dlama\[view\]'"):
        server.serve(contents.contents_of(results), "127.0.0.1", 8080, 1000, False)


@pytest.mark.parametrize(
    ("port", "most", "named"), [(0, 10, "port is 0"), (70000, 10, "port"), (8080, 0, "max_points")]
)
def test_numbers_out_of_range_are_refused(results: Path, port: int, most: int, named: str) -> None:
    with pytest.raises(dlama.InputError, match=named):
        server.serve(contents.contents_of(results), "127.0.0.1", port, most, False)
