"""Bad input gets exit code 2 and one clear line, and leaves nothing behind (oracle: what each line must name)."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from running import FAST, error_line, refused, run

from dlama.apps.cli import main
from dlama.completion import memory
from dlama.errors import CameraError, InputError
from dlama.files.cameras import read_camera
from dlama.geometry.camera import Camera
from posed_folders import LENS, text_K, write_numbered

HUGE = 10**400
PICTURE = ("image.png", "depth.png")
REMOVE = ("remove", *PICTURE, "mask.png", "--fov", 60)
CAMERA = {"width": 64, "height": 48, "fx": 55.4, "fy": 55.4, "cx": 32.0, "cy": 24.0}


@pytest.mark.parametrize(
    ("verb", "of_data_set"),
    [("view", False), ("view", True), ("remove", False), ("remove", True), ("depth", False), ("depth", True)],
)
def test_many_pictures_in_place_of_one(
    frame: Path, capsys: pytest.CaptureFixture[str], verb: str, of_data_set: bool
) -> None:
    """The line names what takes a folder. Oracle: `dlama batch` as the line has it finds the pictures."""
    folder = frame / "many pictures"
    write_numbered(folder)
    if of_data_set:
        (folder / "camera-intrinsics.txt").write_text(text_K(LENS))
    else:
        for path in folder.iterdir():
            path.unlink() if ".color." not in path.name else None
    options = {"view": ("--yaw", "5"), "remove": ("--click", "5,5"), "depth": ()}[verb]
    line = refused(capsys, frame, verb, folder, *options)
    assert ("`dlama sequence` and `dlama video`" in line) == (of_data_set and verb != "depth")
    (command,) = re.findall("`dlama (batch [^`]+)`", line)
    main([*shlex.split(command), *options, "--dry-run"])
    assert capsys.readouterr().out.startswith(f"4 jobs (4 {verb}), 0 of them cannot be run")


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        ("mask ROOM --click 5,5 -o m.png", "ROOM: is a data set (layout tsdf-fusion), a picture is expected\n"),
        ("mask FOLDER --click 5,5 -o m.png", "FOLDER: is a folder, a picture is expected\n"),
        ("stereo FOLDER -o out", "FOLDER: is a folder, the left picture of a pair is expected\n"),
        (
            "stereo ROOM -o out",
            "of a pair is expected; `dlama sequence` and `dlama video` take its frames as one scene\n",
        ),
        ("stereo PAIR -o out", "the left picture of a pair is expected; `dlama batch --data PAIR --verb stereo` takes"),
        ("stereo PAIR/left.png -o out", "right is missing; stereo needs left, right, calib\n"),
        ("stereo PAIR/left.png PAIR/right.png -o out", "--calib is missing; stereo needs left, right, calib\n"),
    ],
)
def test_a_folder_in_place_of_one_picture_of_its_kind(
    frame: Path, capsys: pytest.CaptureFixture[str], words: str, reported: str
) -> None:
    """Law: one line that says what it is; it was a directory, and of `stereo` a table of what is missing."""
    write_numbered(frame / "ROOM")
    (frame / "ROOM" / "camera-intrinsics.txt").write_text(text_K(LENS))
    (frame / "PAIR").mkdir()
    for name in ("left.png", "right.png"):
        shutil.copy(frame / "image.png", frame / "PAIR" / name)
    (frame / "FOLDER").mkdir()
    shutil.copy(frame / "image.png", frame / "FOLDER")
    line = error_line(capsys, *(str(frame / one) if one[0].isupper() or one == "out" else one for one in words.split()))
    assert reported in line.replace(f"{frame}/", "")


def test_a_result_in_place_of_a_picture(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the option that writes what can be read."""
    run(frame, "view", *PICTURE, "--fov", 60, "--yaw", 5, *FAST)
    capsys.readouterr()
    line = error_line(capsys, "view", str(frame / "out"), "--yaw", "5", "-o", str(frame / "further"))
    assert "holds no scene.npz" in line and "--also scene" in line


def test_a_list_of_cameras_in_place_of_one(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The line names what takes a list. Oracle: `dlama sequence` as the line has it makes a view of each camera."""
    cameras = frame / "my cameras.json"
    cameras.write_text(json.dumps([CAMERA, CAMERA]))
    line = refused(capsys, frame, "view", *PICTURE, "--fov", 60, "--to", cameras)
    assert f"{cameras}: holds a list of 2 cameras, one camera is expected" in line
    run(frame, "view", *PICTURE, "--fov", 60, "--yaw", 5, "--also", "scene", *FAST)
    (command,) = re.findall("`dlama (sequence [^`]+)`", line)
    words = [str(frame / "out" / "scene.npz") if word == "SCENE" else word for word in shlex.split(command)]
    main([*words, "-o", str(frame / "done"), *FAST])
    assert len(list((frame / "done" / "images").iterdir())) == 2


@pytest.mark.parametrize(
    ("name", "spoil", "words"),
    [
        ("depth.png", lambda depth: depth[:24, :32], "32x24 64x48 --resize-depth"),
        ("depth.png", lambda depth: depth // 1000, "--depth-scale 1"),
        ("mask.png", lambda mask: mask[:40], "64x40 64x48"),
        ("mask.png", lambda mask: mask // 2 + 20, "--soft-mask"),
    ],
)
def test_bad_files(
    frame: Path, capsys: pytest.CaptureFixture[str], name: str, spoil: Callable[[np.ndarray], np.ndarray], words: str
) -> None:
    """Messages that name an option or two files; those of one file alone are its reader's (tests/files)."""
    cv2.imwrite(str(frame / name), spoil(cv2.imread(str(frame / name), cv2.IMREAD_UNCHANGED)))
    line = refused(capsys, frame, *REMOVE, *FAST)
    assert [word for word in words.split() if word not in line] == [], line


NO_ROTATION = np.diag([2.0, 1, 1, 1]).tolist()
NUMBERS = [HUGE, -HUGE, 1e300, [HUGE], {"a": HUGE}, True, None]


@pytest.mark.parametrize("name", [*CAMERA, "pixel_center", "world_from_cam"])
def test_bad_camera_files(tmp_path: Path, name: str) -> None:
    """Numbers that no camera has, a pose that is no rotation, a K that is singular: file and field are named, in a short line."""
    more = {"world_from_cam": [[[HUGE] * 4] * 4, NO_ROTATION], "fx": [0.0]}
    for value in [*NUMBERS, *more.get(name, [])]:
        (tmp_path / "camera.json").write_text(json.dumps({**CAMERA, name: value}))
        with pytest.raises(CameraError, match=r"camera\.json: ") as caught:
            read_camera(tmp_path / "camera.json")
        line = str(caught.value)
        assert (name in line or value == NO_ROTATION) and "\n" not in line and len(line) < 400


def test_control_characters_of_a_file_do_not_reach_the_terminal(
    frame: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A field's name in a camera file, and a folder's name in a warning and in the last line (oracle: no control character)."""
    (frame / "camera.json").write_text('{"\\u001b[31mred\\u0007\\u202e": 1}')
    line = refused(capsys, frame, "view", *PICTURE, "--camera", "camera.json", "--yaw", 5)
    assert r"field 'fx' is missing; it has \x1b[31mred\x07\u202e" in line
    odd = frame / "odd\x1b[2J"
    files = [str(frame / name) for name in PICTURE]
    main(["view", *files, "--fov", "2", "--yaw", "5", *FAST, "-o", str(odd)])
    printed = capsys.readouterr()
    assert r"odd\x1b[2J" in printed.out and "warning" in printed.err
    assert [sign for sign in printed.out + printed.err if not sign.isprintable() and sign != "\n"] == []


def test_a_dilation_of_holes_over_the_whole_picture(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is known any more: it says so and ends at once."""
    run(frame, "view", *PICTURE, "--fov", 60, "--yaw", 5, *FAST, "--dilate-holes", 1000)
    assert "--dilate-holes leaves nothing of the view" in capsys.readouterr().err


def test_a_target_that_memory_cannot_hold(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Estimated first; the message says how much it would take."""
    for side in (20_000, 100_000):
        big = {"width": side, "height": side, "fx": 5e4, "fy": 5e4, "cx": side / 2, "cy": side / 2}
        (frame / "target.json").write_text(json.dumps(big))
        line = refused(capsys, frame, "view", *PICTURE, "--fov", 60, "--to", frame / "target.json", *FAST)
        assert f"{side}x{side}" in line


def test_memory_is_held_against_what_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    """Closed form: pixels times bytes, either side of the limit; what the system says is a size a machine has."""
    camera = Camera.from_fov(1000, 1000, 60)
    needed = 1_000_000 * (memory.BYTES_PER_PIXEL + memory.BYTES_KEPT)
    assert 10**7 < (memory.available_bytes() or 10**9) < 10**14
    monkeypatch.setattr(memory, "available_bytes", lambda: needed)
    memory.check_memory([camera])
    monkeypatch.setattr(memory, "available_bytes", lambda: needed - 1)
    with pytest.raises(InputError, match=r"1000x1000.*0\.2 GB"):
        memory.check_memory([camera])


def test_a_disparity_that_no_pair_has(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    calib = {"left_K": [[55, 0, 32], [0, 55, 24], [0, 0, 1]], "doffs": 0, "baseline_m": 0.1, "width": 64, "height": 48}
    (frame / "calib.json").write_text(json.dumps(calib))
    for value in ("1e9", "65", "inf"):
        words = "stereo", "image.png", "mask.png", "--calib", "calib.json", "--max-disparity", value, *FAST
        assert "--max-disparity" in refused(capsys, frame, *words)
