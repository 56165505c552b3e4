"""The demo and the stereo verb on the bundled scene (oracles: its answer without the barrel, its rendered depth)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

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
    """Next to them what they read, and nothing else."""
    names = "inputs photo preview.png remove stereo video.webp view"
    assert sorted(path.name for path in demo.iterdir()) == names.split()
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
    assert meta["stereo"]["matcher"] == "semi-global matching" and meta["seconds"]["match"] > 0
    assert set(meta["inputs"]) == {"left", "right", "calib", "mask"}
