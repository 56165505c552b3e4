"""EasySynth's text files with one thing wrong: every error names file, line and column (or field), and what was expected."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from dlama.datasets.easysynth.dataset import easysynth
from dlama.errors import DlamaError
from rendered_walls import edit_json


def replaced(line: int, old: str, new: str) -> Callable[[Path], None]:
    """An edit of one line (counted from 1) of a file."""

    def edit(path: Path) -> None:
        lines = path.read_text().splitlines()
        assert old in lines[line - 1]
        lines[line - 1] = lines[line - 1].replace(old, new, 1)
        path.write_text("\n".join(lines))

    return edit


POSES, EXR = "CameraComponent/CameraPoses.csv", "CameraComponent/DepthImage/seq_with.0001.exr"
SKEWED = [1, 2, 3, 0, 1, 2, 0, 0, 0]
BAD = [
    (POSES, replaced(3, "1,", "1,abc"), r"CameraPoses.csv:3:3: 'abc.*' stands where a finite number"),
    (POSES, replaced(2, "0,0.000000000,", "0, nan,"), r":2:4: 'nan' stands where a finite number"),
    (POSES, replaced(4, "2,", "1,"), r":4:1: id is 1 for the second time"),
    (POSES, replaced(4, "2,", "-2,"), r":4:1: '-2' stands where a whole number >= 0"),
    (POSES, replaced(2, ",1.000000000,", ",0.5,"), r":2:39: the quaternion has length 0.5"),
    (POSES, replaced(2, ",1.000000000", ""), r":2:\d+: the line has 8 values; 9 are expected \(id,tx"),
    (POSES, replaced(1, "id,tx", "nr,tx"), r":1:1: the header is 'nr,tx.*EasySynth 1.2"),
    (POSES, lambda path: path.write_text("id,tx,ty,tz,qx,qy,qz,qw,t\n"), r":2:1: there is no pose"),
    (POSES, lambda path: path.write_bytes(b"id,tx\n\xff\xfa"), r":2:1: is no utf-8-sig text"),
    (POSES, lambda path: path.write_text(""), r"CameraPoses.csv: is empty"),
    (POSES, lambda path: path.write_text("\n \n"), r":1:1: the header is ''"),
    ("CameraRig.json", replaced(3, "{", "{,"), r"CameraRig.json:3:\d+: is no JSON"),
    ("CameraRig.json", lambda path: path.write_text("[]"), r"CameraRig.json:1:1: holds a JSON list"),
    ("CameraRig.json", lambda path: path.write_text("{}"), r"CameraRig.json: cameras is null; an object"),
    ("CameraRig.json", lambda path: edit_json(path, rotation=[0, 0, 1]), r"cameras.CameraComponent: rotation"),
    ("CameraRig.json", lambda path: edit_json(path, rotation=[0, 0, 0, 2]), r"rotation: .* a unit quaternion"),
    ("CameraRig.json", lambda path: edit_json(path, sensor_size=[0, 4]), r"CameraComponent.sensor_size is \[0, 4\]"),
    ("CameraRig.json", lambda path: edit_json(path, intrinsics=SKEWED), r"intrinsics is .*fx 0 cx"),
    ("CameraRig.json", lambda path: edit_json(path, rename="c7"), r"c7/ColorImage: no such folder"),
    ("CameraRig.json", Path.unlink, r"CameraRig.json: no such file, or no camera 'CameraComponent'"),
    ("CameraComponent/ColorImage", shutil.rmtree, r"holds no EasySynth sequence"),
    (EXR, lambda path: shutil.copy(path, path.with_name("x.0001.exr")), "second"),
]


@pytest.mark.parametrize(("name", "edit", "message"), BAD, ids=[str(number) for number in range(len(BAD))])
def test_bad_files_are_named(sequence: Path, name: str, edit: Callable[[Path], None], message: str) -> None:
    """One object wrong in one file: the error names the file, the line and column or the field, what came, what was expected."""
    if name == EXR:
        shutil.rmtree(sequence / "CameraComponent" / "DepthMM")
    edit(sequence / name)
    with pytest.raises(DlamaError, match=message):
        easysynth(sequence, depth_range=10)
