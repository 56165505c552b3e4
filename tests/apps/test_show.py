"""`dlama show`: the page it writes, and what cannot be shown (oracles: the points of the files that were written)."""

from __future__ import annotations

import json
import webbrowser
from pathlib import Path

import numpy as np
import pytest

import dlama
from box_frame import CAMERA, WORLD
from dlama.apps.cli import main
from dlama.datasets.easysynth.writer import write_scene
from dlama.datasets.points import points_in
from dlama.files.scenes.clouds import read_ply
from posed_folders import truth, write_nerfstudio
from rendered_walls import CAMERA as LENS
from rendered_walls import CLASSES, frame


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A removal's results, scene and points."""
    done = dlama.remove(WORLD.rgbd(CAMERA), WORLD.trace(CAMERA)[1] == 1, filler="telea")
    out = tmp_path_factory.mktemp("shown") / "out"
    dlama.write(done, out, only=("scene", "points"))
    return out


def test_a_scene_its_folder_and_its_points_show_the_same(results: Path) -> None:
    """Those of the completed background; a scene and its folder also say from where it is seen first."""
    background = read_ply(results / "scene.ply")
    for path in (results, results / "scene.npz", results / "scene.ply"):
        cloud, camera, note = points_in(path)
        assert len(cloud) == len(background) and note == ""
        assert set(np.unique(cloud.origin)) == set(np.unique(background.origin))
        assert (camera is None) == (path.suffix == ".ply")


def test_a_data_set_shows_one_scene(tmp_path: Path) -> None:
    """Oracle: of two scenes of walls the nearer one, which is the first."""
    for name, depth in (("first", 2.0), ("second", 5.0)):
        frames = [frame(dlama.orbit(LENS, yaw), depth=depth) for yaw in (0, 1)]
        write_scene(tmp_path, name, {"with": frames}, depth_range=10, classes=CLASSES)
    cloud, camera, note = points_in(tmp_path)
    assert len(cloud) >= 16 * 12 and camera is not None and camera.wh == LENS.wh
    assert cloud.points[:, 2].max() < 2.5 and "frames, all of scene" in note


def test_a_frame_alone_is_shown(tmp_path: Path) -> None:
    """Oracle: its pixels. It was refused, as the case of an evaluation needs two."""
    given = truth()[0]
    cloud, _, note = points_in(write_nerfstudio(tmp_path / "one", {"a": given}, {"a": given.camera}))
    assert len(cloud) == given.valid.sum() and note == ""


def test_the_page_is_written_and_opened(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It holds a sample of the points and loads nothing from elsewhere."""
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    page = tmp_path / "page.html"
    main(["show", str(results), "-o", str(page), "--max-points", "100", "--json"])
    assert opened == [page.as_uri()]
    text = page.read_text("utf-8")
    assert "100 points of" in text and "http" not in text and len(text) < 30_000
    said = json.loads(capsys.readouterr().out)
    assert said["page"] == str(page) and said["points"] == len(read_ply(results / "scene.ply"))
    main(["show", str(results), "-o", str(page), "--no-open-browser", "--quiet"])
    assert len(opened) == 1 and page.stat().st_size > len(text) + 5 * said["points"]


def test_what_cannot_be_shown_is_said(tmp_path: Path) -> None:
    """One line that names the path and what is expected."""
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(dlama.FileError, match="no such file or folder"):
        points_in(tmp_path / "none.npz")
    with pytest.raises(dlama.InputError, match=r"notes\.txt: is a \.txt file; a scene\.npz, a \.ply or a folder"):
        points_in(tmp_path / "notes.txt")
    (tmp_path / "notes").write_text("x")
    with pytest.raises(dlama.InputError, match="notes: is a file without an ending; a scene"):
        points_in(tmp_path / "notes")
    with pytest.raises(dlama.InputError, match="no data set of a known layout"):
        points_in(tmp_path)
