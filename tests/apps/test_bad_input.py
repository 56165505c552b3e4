"""Bad input gets exit code 2 and one clear line, and leaves nothing behind (oracle: what each line must name)."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from running import FAST, refused

from dlama.apps.cli import main


def test_nothing_says_where_to_go(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`view` without a move teaches --yaw; with two, both are named."""
    words = ("view", "image.png", "depth.png", "--fov", 60)
    assert "--yaw" in refused(capsys, frame, *words)
    assert "--to" in refused(capsys, frame, *words, "--yaw", 3, "--to", "target.json")


def test_no_intrinsics_teaches_fov(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A PNG has no EXIF focal length."""
    assert "--fov" in refused(capsys, frame, "view", "image.png", "depth.png", "--yaw", 5)


def spoiled(frame: Path, what: str) -> None:
    """Spoil one file of a frame."""
    depth = cv2.imread(str(frame / "depth.png"), cv2.IMREAD_UNCHANGED)
    mask = cv2.imread(str(frame / "mask.png"), cv2.IMREAD_UNCHANGED)
    image = frame / "image.png"
    {
        "image missing": lambda: image.unlink(),
        "image truncated": lambda: image.write_bytes(image.read_bytes()[: image.stat().st_size // 2]),
        "image is text": lambda: image.write_text("hello"),
        "depth smaller": lambda: cv2.imwrite(str(frame / "depth.png"), depth[:24, :32]),
        "depth all zero": lambda: cv2.imwrite(str(frame / "depth.png"), depth * 0),
        "depth in metres": lambda: cv2.imwrite(str(frame / "depth.png"), depth // 1000),
        "depth 8-bit colour": lambda: (frame / "depth.png").write_bytes(image.read_bytes()),
        "mask empty": lambda: cv2.imwrite(str(frame / "mask.png"), mask * 0),
        "mask full": lambda: cv2.imwrite(str(frame / "mask.png"), mask * 0 + 255),
        "mask smaller": lambda: cv2.imwrite(str(frame / "mask.png"), mask[:40]),
        "mask grey": lambda: cv2.imwrite(str(frame / "mask.png"), mask // 2 + 20),
    }[what]()


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("image missing", ["image.png", "no such file"]),
        ("image truncated", ["image.png", "truncated"]),
        ("image is text", ["image.png"]),
        ("depth smaller", ["32x24", "64x48", "--resize-depth nearest"]),
        ("depth all zero", ["depth.png"]),
        ("depth in metres", ["--depth-scale 1"]),
        ("depth 8-bit colour", ["8-bit colour"]),
        ("mask empty", ["mask", "empty"]),
        ("mask full", ["mask", "full"]),
        ("mask smaller", ["64x40", "64x48"]),
        ("mask grey", ["--soft-mask"]),
    ],
)
def test_bad_files(frame: Path, capsys: pytest.CaptureFixture[str], what: str, words: list[str]) -> None:
    """Each gets exit code 2 and one line with these words, and leaves nothing behind."""
    spoiled(frame, what)
    line = refused(capsys, frame, "remove", frame / "image.png", "depth.png", "mask.png", "--fov", 60, *FAST)
    assert [word for word in words if word not in line] == [], line


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--fx", "-3"], ["-3", "> 0"]),
        (["--fov", "190"], ["190"]),
        (["--fov", "60", "--fx", "3"], ["--fov", "--fx"]),
        (["--fov", "60", "--filler", "magic"], ["magic", "layered", "telea"]),
        (["--fov", "60", "--recipe", "soup"], ["soup", "dlama", "paper"]),
        (["--fov", "60", "--dilate", "-1"], ["dilate", "-1"]),
        (["--fov", "60", "--far", "0.5"], ["--far"]),
        (["--fov", "60", "--pivot", "-2"], ["-2"]),
    ],
)
def test_bad_options(frame: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: list[str]) -> None:
    """Each gets exit code 2 and one line that names what came and what is expected."""
    line = refused(capsys, frame, "view", "image.png", "depth.png", "--yaw", 5, *options)
    assert [word for word in words if word not in line] == [], line


@pytest.mark.parametrize(("name", "value"), [("world_from_cam", np.diag([2.0, 1, 1, 1]).tolist()), ("fx", 0.0)])
def test_bad_camera_file(frame: Path, capsys: pytest.CaptureFixture[str], name: str, value: object) -> None:
    """A pose that is no rotation, a K that is singular: the file is named."""
    fields = {"width": 64, "height": 48, "fx": 55.4, "fy": 55.4, "cx": 32.0, "cy": 24.0, name: value}
    (frame / "camera.json").write_text(json.dumps(fields))
    line = refused(capsys, frame, "view", "image.png", "depth.png", "--camera", "camera.json", "--yaw", 5)
    assert "camera.json" in line


def test_control_characters_of_a_file_do_not_reach_the_terminal(
    frame: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A field's name in a camera file, and a folder's name in a warning and in the last line (oracle: no control character)."""
    (frame / "camera.json").write_text('{"\\u001b[31mred\\u0007\\u202e": 1}')
    line = refused(capsys, frame, "view", "image.png", "depth.png", "--camera", "camera.json", "--yaw", 5)
    assert r"field '\x1b[31mred\x07\u202e' is not known" in line
    odd = frame / "odd\x1b[2J"
    main(
        ["view", str(frame / "image.png"), str(frame / "depth.png"), "--fov", "2", "--yaw", "5", *FAST, "-o", str(odd)]
    )
    printed = capsys.readouterr()
    assert r"odd\x1b[2J" in printed.out and "warning" in printed.err
    assert [sign for sign in printed.out + printed.err if not sign.isprintable() and sign != "\n"] == []


def test_output_that_cannot_be_written(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file is where the directory should be."""
    (frame / "out").write_text("in the way")
    line = refused(capsys, frame, "view", "image.png", "depth.png", "--fov", 60, "--yaw", 5, *FAST)
    assert "cannot be written" in line
    assert (frame / "out").read_text() == "in the way"
