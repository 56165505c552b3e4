"""Where a verb may not write: refused in one line before any work (oracles: what is on disk, readers that may not be called)."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest
from running import error_line

import dlama
import dlama.datasets.layouts  # these bind their readers before the fixture replaces them
import dlama.jobs.verbs
from box_frame import small_frame
from dlama.apps import cli
from dlama.apps.cli import VERBS, main
from dlama.apps.terminal.flags import flags_of

WORK = (
    "dlama.files.rgbd.read_rgbd",
    "dlama.files.rasters.pictures.read_color",
    "dlama.files.rasters.masks.read_mask",
    "dlama.jobs.inputs.read_rgbd",
    "dlama.jobs.inputs.read_color",
    "dlama.jobs.inputs.read_mask",
)
"""What every job on pictures does first."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A frame in the current folder, and readers that fail: nothing may be read."""
    small_frame(tmp_path)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "model.pt").write_bytes(b"weights")
    (tmp_path / "scene.webp").write_bytes(b"scene")
    (tmp_path / "jobs.csv").write_text("id,verb,image,yaw\na,view,image.png,5\n")
    monkeypatch.chdir(tmp_path)

    def worked(*_: Any, **__: Any) -> None:
        raise AssertionError("something was read or computed")

    for name in WORK:
        monkeypatch.setattr(name, worked)
    for name in ("view", "remove", "stereo"):
        monkeypatch.setattr(dlama.jobs.verbs, name, worked)
    return tmp_path


PICTURE = "image.png depth.png"
REFUSED = {
    "view": (f"view {PICTURE} --fov 60 --yaw 5 -o .", "--output is ., the folder of the image image.png"),
    "view, by another path": (f"view {PICTURE} --fov 60 --yaw 5 -o scenes/..", "the folder of the image image.png"),
    "view, a linked picture": ("view scenes/linked.png depth.png --fov 60 --yaw 5 -o {folder}", "linked.png"),
    "photo3d": (f"photo3d {PICTURE} --fov 60 -o .", "--output is ., the folder of the image image.png"),
    "view, no home": (f"view {PICTURE} --fov 60 --yaw 5 --output=~/out", "~/out: cannot be written: ~ is the home"),
    "view, a file's name": (
        f"view {PICTURE} --fov 60 --yaw 5 -o new.PNG",
        "new.PNG: is the name of a file; a folder is expected",
    ),
    "photo3d, a file's name": (
        f"photo3d {PICTURE} --fov 60 -o scenes/turns.html",
        "turns.html: is the name of a file; a folder",
    ),
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
    "train": ("train tiny --data scenes -o scenes", "(data scenes)"),
    "sequence": ("sequence scenes -o scenes", "--output is scenes, an input of this run (data set)"),
    "video": ("video scene.webp -o scene.webp", "--output is scene.webp, an input of this run (what is shown)"),
    "show": ("show scene.webp -o scene.webp", "--output is scene.webp, an input of this run (what is shown)"),
    "batch": ("batch jobs.csv -o .", "--output is ., the folder of the list of jobs jobs.csv"),
    "batch, of a data set": ("batch --data scenes -o scenes", "an input of this run (folder of frames)"),
    "models": ("models convert model.pt -o model.onnx", "--output is model.onnx, an input of this run (weights)"),
}
WITHOUT_BOTH = {"demo", "doctor", "version", "serve", "warm-up"}
"""Verbs that read nothing of the user's, or write nothing."""


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_read_is_not_written_over(case: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line, exit code 2, no file changed or added, nothing read."""
    (folder / "scenes" / "linked.png").symlink_to(folder / "image.png")
    (folder / "image_overlay.png").write_bytes((folder / "image.png").read_bytes())
    os.link(folder / "model.pt", folder / "model.onnx")
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    words, reported = REFUSED[case]
    assert reported in error_line(capsys, *words.format(folder=folder).split())
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_every_verb_that_reads_and_writes_is_here() -> None:
    """Law: a verb with an output that is not in the table fails this test."""
    assert {case.partition(",")[0] for case in REFUSED} == set(VERBS) - WITHOUT_BOTH
    assert cli.demo is VERBS["demo"]


def test_a_batch_refuses_a_folder_named_as_a_file(folder: Path) -> None:
    """Oracle: the command line's message, before anything is read; no such folder is made."""
    before = sorted(folder.iterdir())
    with pytest.raises(dlama.OutputError, match=r"done\.\w+: is the name of a file; a folder is expected"):
        list(dlama.batch([{"id": "a", "verb": "view", "image": "image.png"}], "done.json"))
    assert sorted(folder.iterdir()) == before


def test_another_folder_next_to_or_inside_is_fine(folder: Path) -> None:
    """Law: an output inside the folder of an input, and one that is not there yet, continue to the reading."""
    for place in ("out", "scenes"):
        with pytest.raises(AssertionError, match="something was read"):
            main(["view", "image.png", "depth.png", "--fov", "60", "--yaw", "5", "-o", place])


LATE = {
    "view": "view image.png --fov 60 --yaw 5 -o out",
    "remove": "remove image.png --fov 60 --click 30,25 -o out",
    "stereo": "stereo image.png image.png --calib calib.txt --click 30,25 -o out",
    "depth": "depth image.png --fov 60 -o out",
    "mask": "mask image.png --fov 60 --click 30,25 -o out.png",
}
WRONG = {
    "--only image,colour": "--only is 'colour'; names of image, ",
    "--only image,mask": "no object is removed",
    "--filler magic": "--filler is 'magic'; one of auto, layered, layered-patches, telea, ",
    "--filler lama": "--model is missing: filler 'lama'",
    "--recipe soup": "--recipe is 'soup'; one of dlama, paper",
    "--dilate -1": "--dilate is -1",
    "--clip 0": "--clip is 0.0 m",
    "--seed -1": "--seed is -1",
    "--min-confidence 2": "--min-confidence is 2.0; a probability",
    "--far -1": "--far is -1.0",
    "--yaw nan": "--yaw is nan",
    "--pivot -1 --yaw 3": "--pivot is -1.0",
    "--metres-at 99,3=2": "--metres-at 99,3=2: lies outside the 64x48 picture",
    "--metres-at 9,3=-2": "-2 m is no distance",
    "--camera-height 0": "--camera-height is 0 m",
    "--masker soup": "--masker is 'soup'",
    "--candidate soup": "--candidate is 'soup'",
    "--mask-model sam-vit-b": "--mask-model is given and the masker 'rgbd'",
    "--click 30": "--click is '30'; X,Y in pixels is expected",
    "--click 300,2": "--click holds 300,2, which lies outside the picture",
    "--box 1,2,3": "--box is '1,2,3'; X,Y,W,H in pixels is expected",
    "--box 900,2,3,3 --click 3,3": "--box is 900,2,3,3, which is no part of the picture of 64x48",
    "-o loop": "loop: cannot be written: too many levels of symbolic links",
    "-o image.png/out": "image.png is a file, a directory is expected",
}
"""Words -> what the line must say."""


RIGHT = {
    ("remove", "--only image,mask"),
    ("stereo", "--only image,mask"),
    ("mask", "-o loop"),
    ("mask", "-o image.png/out"),
}
"""Of these verbs the words are right, or another message comes first."""


def takes(verb: str, words: str) -> bool:
    """Whether a verb has the options of some words."""
    return {word for word in words.split() if re.fullmatch(r"--?[a-z].*", word)} <= {
        *flags_of(VERBS[verb]).values(),
        "-o",
    }


@pytest.mark.parametrize(
    ("verb", "words"),
    [(verb, words) for verb in LATE for words in WRONG if takes(verb, words) and (verb, words) not in RIGHT],
)
def test_what_can_be_refused_early_is(verb: str, words: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Options, names and output folders are checked before pictures are read (oracle: readers that fail)."""
    (folder / "loop").symlink_to("loop")
    command = LATE[verb].split()
    for flag in ("-o", "--click", "--yaw"):
        if flag in words.split() and flag in command:
            place = command.index(flag)
            del command[place : place + 2]
    assert WRONG[words] in error_line(capsys, *command, *words.split())


def test_all_wrong_options_are_named_at_once(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line with every one of them, so that one run finds all (oracle: the words themselves)."""
    wrong = ("--only image,colour", "--filler magic", "--dilate -1", "--seed -1", "--min-confidence 2", "--far -1")
    line = error_line(capsys, *LATE["remove"].split(), *" ".join(wrong).split())
    assert [words for words in wrong if WRONG.get(words, "--only is 'colour'") not in line] == []
