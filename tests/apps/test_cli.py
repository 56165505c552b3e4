"""The command line, run in this process on a small made-up frame (oracles: names of options and files, the files' readers)."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from running import FAST, pixels, run

from box_frame import CAMERA, WORLD
from dlama.apps.cli import main
from dlama.files.rasters.depth import write_depth_exr

RESULT_FILES = {
    "image.png", "depth.png", "depth.exr", "origin.png", "confidence.png", "scene.glb", "preview.png", "meta.json",
}  # fmt: skip


def test_view_writes_every_file_and_meta_tells_what_was_done(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracles: a list of files; hole.png is where hole_type.png is not 0; one summary line; hashlib on the inputs, the codes'
    counts in hole_type.png, the camera's closed form."""
    out = run(frame, "view", "image.png", "depth.png", "--fov", 60, "--yaw", 12, "--seed", 3, "--also", "hole", *FAST)
    assert {path.name for path in out.iterdir()} == RESULT_FILES | {"hole.png", "hole_type.png"}
    hole = pixels(out / "hole.png")
    kinds = pixels(out / "hole_type.png")
    assert set(np.unique(hole)) == {0, 255}
    assert ((hole == 255) == (kinds > 0)).all()
    captured = capsys.readouterr()
    assert captured.err == ""
    assert re.fullmatch(rf"{re.escape(str(out))}: \d+\.\d% was unknown .*telea.* s\n", captured.out)
    meta = json.loads((out / "meta.json").read_text())
    for role in ("image", "depth"):
        assert meta["inputs"][role]["sha256"] == hashlib.sha256((frame / f"{role}.png").read_bytes()).hexdigest()
    names = {int(code): entry[0] for code, entry in meta["legends"]["hole_type.png"].items()}
    for code, name in names.items():
        if code:
            assert meta["hole_share_by_type"][0][name] == pytest.approx((kinds == code).mean(), abs=1e-6)
    assert meta["source_camera"]["fx"] == pytest.approx(32 / np.tan(np.radians(30)))
    assert meta["source_camera"]["intrinsics_from"] == "fov"
    assert (meta["filler"], meta["recipe"]["name"], meta["seed"]) == ("telea", "dlama", 3)
    assert meta["law_violations"] == 0
    assert {"read", "render", "fill", "write"} <= set(meta["seconds"])
    assert {"dlama", "python", "numpy", "numba", "opencv"} <= set(meta["versions"])
    assert meta["depth_png_clipped_pixels"] == 0


def test_depth_beyond_16_bit_is_counted(frame: Path) -> None:
    """Pixels deeper than 65.534 m are counted in meta.json and exact in depth.exr (oracle: how many were written)."""
    depth = WORLD.rgbd(CAMERA).depth.copy()
    depth[:3, :5] = 80.0
    write_depth_exr(frame / "depth.exr", depth)
    out = run(frame, "remove", "image.png", "depth.exr", "mask.png", "--fov", 60, *FAST)
    assert json.loads((out / "meta.json").read_text())["depth_png_clipped_pixels"] == 15


def test_misspelt_option_exits_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    """The parser's own errors have the same exit code."""
    with pytest.raises(SystemExit) as stop:
        main(["view", "a.png", "b.png", "-o", "out", "--yaww", "3"])
    assert stop.value.code == 2
    assert "--yaww" in capsys.readouterr().err


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    """One line per package; of `--version` one line (oracle: the package's own number)."""
    import dlama

    line = f"dlama {dlama.__version__}\n"
    main(["version"])
    assert capsys.readouterr().out.startswith(line)
    main(["--version"])
    assert capsys.readouterr().out == line
