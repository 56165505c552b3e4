"""Numbers that no camera, mask or machine has: exit code 2, one line with the option or the file and field, no memory taken."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from running import FAST, refused

from dlama.completion import memory
from dlama.errors import InputError
from dlama.geometry.camera import Camera

HUGE = 10**400
CAMERA = {"width": 64, "height": 48, "fx": 55.4, "fy": 55.4, "cx": 32.0, "cy": 24.0}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--fov", "60", "--seed", "-1"], ["--seed", "-1", "0"]),
        (["--fov", "60", "--seed", "99999999999"], ["--seed", "99999999999"]),
        (["--fx", "1e-200"], ["fx", "1e-200"]),
        (["--fx", "1e300"], ["fx", "1e+300"]),
        (["--fx", "50", "--cx", "1e300"], ["cx", "1e+300"]),
        (["--fov", "1e-12"], ["fx"]),
        (["--fov", "60", "--dolly", "1e300"], ["--dolly", "1e+300"]),
        (["--fov", "60", "--pivot", "1e300"], ["--pivot", "1e+300"]),
    ],
)
def test_bad_numbers_of_a_view(
    frame: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: list[str]
) -> None:
    line = refused(capsys, frame, "view", "image.png", "depth.png", "--yaw", 5, *FAST, *options)
    assert [word for word in words if word not in line] == [], line


@pytest.mark.parametrize("radius", [5000, 100_000, 10**12])
def test_a_dilation_over_the_whole_picture(frame: Path, capsys: pytest.CaptureFixture[str], radius: int) -> None:
    """It used to take minutes or gigabytes."""
    line = refused(
        capsys, frame, "remove", "image.png", "depth.png", "mask.png", "--fov", 60, "--dilate", radius, *FAST
    )
    assert "--dilate" in line and str(radius) in line


@pytest.mark.parametrize("option", [["--dilate-holes", "1000"]])
def test_a_dilation_of_holes_over_the_whole_picture(
    frame: Path, capsys: pytest.CaptureFixture[str], option: list[str]
) -> None:
    """Nothing is known any more: it says so and ends at once."""
    from running import run

    run(frame, "view", "image.png", "depth.png", "--fov", 60, "--yaw", 5, *FAST, *option)
    assert "nothing" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["width", "height", "fx", "cx", "pixel_center", "world_from_cam"])
@pytest.mark.parametrize("value", [HUGE, -HUGE, 1e300, [HUGE], {"a": HUGE}, True, None])
def test_numbers_too_large_in_a_camera_file(
    frame: Path, capsys: pytest.CaptureFixture[str], name: str, value: object
) -> None:
    bad = [[HUGE] * 4] * 4 if name == "world_from_cam" and value == HUGE else value
    (frame / "camera.json").write_text(json.dumps({**CAMERA, name: bad}))
    line = refused(capsys, frame, "view", "image.png", "depth.png", "--camera", "camera.json", "--yaw", 5, *FAST)
    assert "camera.json" in line and name in line
    assert len(line) < 400


def test_a_target_that_memory_cannot_hold(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Estimated first; the message says how much it would take."""
    for side in (20_000, 100_000):
        big = {"width": side, "height": side, "fx": 5e4, "fy": 5e4, "cx": side / 2, "cy": side / 2}
        (frame / "target.json").write_text(json.dumps(big))
        line = refused(
            capsys, frame, "view", "image.png", "depth.png", "--fov", 60, "--to", frame / "target.json", *FAST
        )
        assert f"{side}x{side}" in line


def test_memory_is_held_against_what_is_free() -> None:
    """Closed form: pixels times bytes, either side of the limit; what the system says is a size a machine has."""
    camera = Camera.from_fov(1000, 1000, 60)
    needed = 1_000_000 * (memory.BYTES_PER_PIXEL + memory.BYTES_KEPT)
    memory.check_memory([camera], needed)
    with pytest.raises(InputError, match=r"1000x1000.*0\.2 GB"):
        memory.check_memory([camera], needed - 1)
    assert 10**7 < (memory.available_bytes() or 10**9) < 10**14


def test_a_disparity_that_no_pair_has(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    calib = {"left_K": [[55, 0, 32], [0, 55, 24], [0, 0, 1]], "doffs": 0, "baseline_m": 0.1, "width": 64, "height": 48}
    (frame / "calib.json").write_text(json.dumps(calib))
    for value in ("1e9", "65", "inf"):
        words = "stereo", "image.png", "mask.png", "--calib", "calib.json", "--max-disparity", value, *FAST
        assert "--max-disparity" in refused(capsys, frame, *words)


@pytest.mark.parametrize("color", ["256,0,0", "-1,0,0", "0,0,99999999999999999999"])
def test_class_colours_are_bytes(frame: Path, capsys: pytest.CaptureFixture[str], color: str) -> None:
    words = "remove", "image.png", "depth.png", "mask.png", "--fov", 60, f"--mask-class={color}", *FAST
    line = refused(capsys, frame, *words)
    assert "--mask-class" in line and "255" in line
