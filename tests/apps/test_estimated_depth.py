"""Pictures without a depth file on the command line (oracles: the codes' meaning, the numbers typed in)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from running import FAST, pixels, refused, run

import dlama
from dlama.files.scenes.clouds import read_ply
from dlama.geometry.codes import Origin

pytestmark = pytest.mark.filterwarnings("ignore:the (field of view|scale)")


def meta_of(out: Path) -> dict:
    """What meta.json says."""
    return json.loads((out / "meta.json").read_text())


def test_view_of_a_photo_alone(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every output says that depth is estimated; what is assumed is said in two warnings and in meta.json."""
    out = run(frame, "view", "image.png", "--yaw", 8, *FAST)
    meta, reported = meta_of(out), capsys.readouterr().err
    assert reported.count("warning: ") == 2 and "give --fov or --camera" in reported
    assert "give --metres-at, --camera-height or a metric --depth-model" in reported
    assert (meta["depth"], meta["depth_estimate"]["scale"]["rule"]) == ("estimated", "assumed")
    assert meta["source_camera"]["intrinsics_from"] == meta["depth_estimate"]["field_of_view"]["from"] == "assumed"
    assert set(meta["inputs"]) == {"image"}
    origin = pixels(out / "origin.png")
    assert set(np.unique(origin)) == {Origin.ESTIMATED, Origin.FILLED}
    assert meta["legends"]["origin.png"]["5"][0] == "estimated"
    assert pixels(out / "confidence.png").max() < 255


def test_what_is_known_is_used_and_not_warned_of(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Closed form: the pixel has the depth that was typed; far puts what is beyond at infinity."""
    options = ["--fov", 60, "--metres-at", "32,24=2.5", "--far", 6, "--no-sharpen"]
    out = run(frame, "view", "image.png", "--yaw", 0, *options, *FAST)
    meta, depth = meta_of(out), pixels(out / "depth.png")
    assert capsys.readouterr().err == ""
    assert depth[24, 32] == pytest.approx(2500, rel=0.02)
    assert depth[depth < 65535].max() < 6000
    assert meta["depth_estimate"]["scale"]["points"][0]["metres"] == 2.5 and not meta["depth_estimate"]["sharpened"]
    assert meta["source_camera"]["intrinsics_from"] == "fov"


def test_remove_from_a_photo_alone(frame: Path) -> None:
    """The mask comes last, with depth or without."""
    out = run(frame, "remove", "image.png", "mask.png", "--fov", 60, *FAST)
    mask = pixels(frame / "mask.png") > 0
    assert (pixels(out / "origin.png")[mask] == Origin.FILLED).all() and meta_of(out)["depth"] == "estimated"
    assert (
        meta_of(run(frame, "remove", "image.png", "depth.png", "mask.png", "--fov", 60, *FAST))["depth"] == "measured"
    )


def test_a_photo_of_nothing_gets_one_line(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One colour all over."""
    Image.fromarray(np.full((48, 64, 3), 200, np.uint8)).save(frame / "blank.png")
    assert "nearly one colour all over" in refused(capsys, frame, "view", "blank.png", "--fov", 60, "--yaw", 5)


def test_depth_of_a_photo_as_files(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracles: the files' own readers agree with each other, the cloud with depth and camera; meta.json says the scale."""
    out = run(frame, "depth", "image.png", "--fov", 60, "--metres-at", "32,24=2.5")
    assert {path.name for path in out.iterdir()} == {
        "depth.png", "depth.exr", "preview.png", "camera.json", "cloud.ply", "meta.json",
    }  # fmt: skip
    again = dlama.read_rgbd(frame / "image.png", out / "depth.exr", camera=out / "camera.json")
    assert dlama.read_camera(out / "meta.json").same_view_as(again.camera)
    np.testing.assert_allclose(pixels(out / "depth.png"), again.depth * 1000, atol=0.51)
    cloud = read_ply(out / "cloud.ply")
    np.testing.assert_allclose(cloud.points, dlama.lift(again).points, atol=1e-5)
    assert set(cloud.origin) == {Origin.ESTIMATED}
    meta = meta_of(out)
    assert meta["depth"] == "estimated" and meta["depth_estimate"]["scale"]["rule"] == "metres_at"
    assert "scale from --metres-at" in capsys.readouterr().out
