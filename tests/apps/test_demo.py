"""The demo and the stereo verb on the bundled scene (oracles: its answer without the barrel, its rendered depth)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import dlama
from box_frame import pixels
from dlama.apps.cli import main
from dlama.apps.verbs.demo import ASSETS
from dlama.files.rasters.depth import read_depth, read_disparity


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`dlama demo`, run once."""
    folder = tmp_path_factory.mktemp("demo") / "out"
    main(["demo", "--also", "hole,disparity,points", "-o", str(folder)])
    return folder


@pytest.mark.slow
def test_all_jobs_and_a_joint_sheet(demo: Path) -> None:
    """Beside them what they read, and nothing else."""
    assert sorted(path.name for path in demo.iterdir()) == [
        "inputs",
        "photo",
        "preview.png",
        "remove",
        "stereo",
        "video.webp",
        "view",
    ]
    with Image.open(demo / "video.webp") as video:
        assert video.n_frames == 2 * 16 - 2 and video.size == (256, 256)  # type: ignore[attr-defined]
    assert all((demo / job / "preview.png").is_file() for job in ("photo", "remove", "stereo", "view"))
    assert pixels(demo / "preview.png").shape[1] >= 1200
    assert all(path.read_bytes() == (ASSETS / path.name).read_bytes() for path in (demo / "inputs").iterdir())


@pytest.mark.slow
def test_removal_comes_near_the_answer(demo: Path) -> None:
    """Inside the mask: nearer to the street without the barrel than the picture with it (oracle: the rendered answer)."""
    mask = pixels(ASSETS / "mask.png") == 255
    answer, before = pixels(ASSETS / "without.jpg").astype(float), pixels(ASSETS / "street.jpg")
    after = pixels(demo / "remove" / "image.png")
    error = {name: np.abs(picture - answer)[mask].mean() for name, picture in (("before", before), ("after", after))}
    assert error["after"] < 0.5 * error["before"]
    truth = read_depth(ASSETS / "depth_without.png")
    off = np.abs(read_depth(demo / "remove" / "depth.exr")[mask] - truth[mask]) / truth[mask]
    assert np.median(off) < 0.02


@pytest.mark.slow
def test_a_click_on_the_photo_alone_takes_barrel_and_shadow(demo: Path) -> None:
    """What is taken holds nine tenths of the drawn mask of barrel and shadow, and is mostly that."""
    drawn = pixels(ASSETS / "mask.png") == 255
    taken = pixels(demo / "photo" / "hole_type.png") == 6
    assert (taken & drawn).sum() > 0.9 * drawn.sum() and (taken & drawn).sum() > 0.6 * taken.sum()
    meta = json.loads((demo / "photo" / "meta.json").read_text("utf-8"))
    assert meta["depth"] == "estimated" and meta["object_mask"]["clicks"] == [[256.0, 345.0]]


@pytest.mark.slow
def test_stereo_depth_is_the_rendered_depth(demo: Path) -> None:
    """Left disparity against fx * baseline / depth, away from the barrel (oracle: the renderer)."""
    truth = read_depth(ASSETS / "depth_without.png")
    measured = pixels(demo / "stereo" / "hole_type.png") == 0
    near = measured & (truth < 12)
    disparity = read_disparity(demo / "stereo" / "disparity_left.pfm")
    assert np.median(np.abs(disparity - 256 * 0.12 / np.where(near, truth, 1))[near]) < 0.25


@pytest.mark.slow
def test_stereo_files(demo: Path) -> None:
    """Both views, both disparities, and how well they agree."""
    names = {path.relative_to(demo / "stereo").as_posix() for path in (demo / "stereo").rglob("*.p*")}
    assert {"image.png", "right/image.png", "disparity_left.pfm", "disparity_right.pfm", "completed.ply"} <= names
    meta = json.loads((demo / "stereo" / "meta.json").read_text())
    assert 0.5 < meta["stereo"]["consistency"]["left_right_within_1px"] <= 1
    assert set(meta["inputs"]) == {"left", "right", "calib", "mask"}


@pytest.mark.slow
def test_a_pair_from_another_viewpoint(demo: Path, tmp_path: Path) -> None:
    """Its scene seen from there, and how its depth was made (oracle: `dlama.view` of the scene that `dlama.stereo` gives)."""
    inputs = demo / "inputs"
    words = [str(inputs / "street.jpg"), str(inputs / "right.jpg"), "--calib", str(inputs / "calib.txt")]
    main(["stereo", *words, "--filler", "telea", "--yaw", "8", "--only", "image", "-o", str(tmp_path / "moved")])
    left, right = (dlama.read_color(inputs / name) for name in ("street.jpg", "right.jpg"))
    pair = dlama.stereo(left, right, dlama.read_stereo_calib(inputs / "calib.txt"), filler="telea")
    expected = dlama.view(pair.scene, yaw=8, filler="telea").view.color
    np.testing.assert_array_equal(pixels(tmp_path / "moved" / "image.png"), expected)
    meta = json.loads((tmp_path / "moved" / "meta.json").read_text("utf-8"))
    assert meta["stereo"]["matcher"] == "semi-global matching" and meta["seconds"]["match"] > 0
    assert not (tmp_path / "moved" / "right").exists()


@pytest.mark.slow
def test_a_user_can_go_on_from_the_inputs(demo: Path, tmp_path: Path) -> None:
    """The demo's own removal with the files it wrote (oracle: its pixels)."""
    files = [str(demo / "inputs" / name) for name in ("street.jpg", "depth.png", "mask.png")]
    main(["remove", *files, "--camera", str(demo / "inputs" / "camera.json"), "-o", str(tmp_path / "out")])
    assert (pixels(tmp_path / "out" / "image.png") == pixels(demo / "remove" / "image.png")).all()
