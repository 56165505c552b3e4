"""Where a verb may not write: refused in one line before any work (oracles: what is on disk, readers that may not be called)."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest

import dlama
from box_frame import small_frame
from dlama.apps import cli
from dlama.apps.cli import VERBS, main

WORK = (
    "dlama.files.rgbd.read_rgbd",
    "dlama.files.rasters.pictures.read_color",
    "dlama.files.rasters.pictures.read_mask",
)
"""What every job on pictures does first."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A frame in the current folder, and readers that fail: nothing may be read."""
    small_frame(tmp_path)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "model.pt").write_bytes(b"weights")
    for name in ("pack.dlama", "scene.webp"):
        (tmp_path / name).write_bytes(b"pack")
    (tmp_path / "jobs.csv").write_text("id,verb,image,yaw\na,view,image.png,5\n")
    monkeypatch.chdir(tmp_path)

    def worked(*_: Any, **__: Any) -> None:
        raise AssertionError("something was read or computed")

    for name in WORK:
        monkeypatch.setattr(name, worked)
    for name in ("view", "remove", "stereo", "find_mask"):
        monkeypatch.setattr(dlama, name, worked)
    return tmp_path


PICTURE = "image.png depth.png"
REFUSED = {
    "view": (f"view {PICTURE} --fov 60 --yaw 5 -o .", "--output is ., the folder of the image image.png"),
    "view, by another path": (f"view {PICTURE} --fov 60 --yaw 5 -o scenes/..", "the folder of the image image.png"),
    "view, a linked picture": ("view scenes/linked.png depth.png --fov 60 --yaw 5 -o {folder}", "linked.png"),
    "remove": ("remove image.png mask.png --fov 60 -o .", "the folder of the image"),
    "mask": (
        f"mask {PICTURE} --fov 60 --click 3,3 -o image.png",
        "--output is image.png, an input of this run (image)",
    ),
    "mask, its overlay": ("mask image_overlay.png depth.png --fov 60 --click 3,3 -o image.png", "image_overlay.png"),
    "stereo": ("stereo image.png depth.png --calib calib.txt -o .", "the folder of the left image.png"),
    "depth": ("depth image.png -o .", "the folder of the image"),
    "evaluate": ("evaluate scenes -o scenes", "--output is scenes, an input of this run (data set)"),
    "worlds": ("worlds --textures scenes -o scenes", "(folder of textures)"),
    "train": ("train tiny --data scenes -o scenes", "(--data scenes)"),
    "pack": ("pack pack.dlama -o pack.dlama", "--output is pack.dlama, an input of this run (data pack.dlama)"),
    "sequence": ("sequence scenes -o scenes", "--output is scenes, an input of this run (data set)"),
    "video": ("video scene.webp -o scene.webp", "--output is scene.webp, an input of this run (what is shown)"),
    "batch": ("batch jobs.csv -o .", "--output is ., the folder of the list of jobs jobs.csv"),
    "batch, of a data set": ("batch --data scenes -o scenes", "an input of this run (folder of frames)"),
    "models": ("models convert model.pt -o model.onnx", "--output is model.onnx, an input of this run (weights)"),
}
WITHOUT_BOTH = {"demo", "doctor", "version", "show", "serve"}
"""Verbs that read nothing of the user's, or write nothing."""


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_read_is_not_written_over(case: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line, exit code 2, no file changed or added, nothing read."""
    (folder / "scenes" / "linked.png").symlink_to(folder / "image.png")
    (folder / "image_overlay.png").write_bytes((folder / "image.png").read_bytes())
    os.link(folder / "model.pt", folder / "model.onnx")
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    words, told = REFUSED[case]
    with pytest.raises(SystemExit) as stop:
        main(words.format(folder=folder).split())
    captured = capsys.readouterr()
    assert stop.value.code == 2 and captured.out == ""
    assert re.fullmatch(r"error: [^\n]+\n", captured.err) and told in captured.err, captured.err
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_every_verb_that_reads_and_writes_is_here() -> None:
    """Law: a verb with an output that is not in the table fails this test."""
    assert {case.partition(",")[0] for case in REFUSED} == set(VERBS) - WITHOUT_BOTH
    assert cli.demo is VERBS["demo"]


def test_another_folder_beside_or_inside_is_fine(folder: Path) -> None:
    """Law: an output inside the folder of an input, and one that is not there yet, go on to the reading."""
    for place in ("out", "scenes"):
        with pytest.raises(AssertionError, match="something was read"):
            main(["view", "image.png", "depth.png", "--fov", "60", "--yaw", "5", "-o", place])
