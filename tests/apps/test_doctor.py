"""`dlama doctor` as people run it (oracle: the bundled street scene, good and wrongly read)."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import dlama
from dlama.apps.cli import main
from dlama.datasets.easysynth.writer import write_scene
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.projection import rays
from rendered_walls import CAMERA, CLASSES, frame

STREET = [str(dlama.example() / name) for name in ("street.jpg", "depth.png", "mask.png")]


def test_good_inputs_get_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    main(["doctor", *STREET, "--fov", "90"])
    captured = capsys.readouterr()
    assert captured.err == "" and captured.out.count("\n") == 1 and "nothing wrong: 512x512" in captured.out


def test_faults_name_flags_and_end_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    words = [*STREET, "--fov", "90", "--depth-scale", "200", "--mask-polarity", "known"]
    with pytest.raises(SystemExit) as stop:
        main(["doctor", *words])
    lines = capsys.readouterr().out.splitlines()
    assert stop.value.code == 1 and len(lines) == 3
    for line, flag in zip(lines, ("give --depth-scale 1000 (certain)", "--mask-polarity")):
        assert flag in line


def test_depth_that_is_none_along_the_ray_is_named(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Oracle: the street's depth is along the optical axis; written as distances (times the length of the ray whose z is 1),
    --radial-depth is right."""
    with pytest.raises(SystemExit):
        main(["doctor", *STREET[:2], "--fov", "90", "--radial-depth"])
    assert "read as the distance along the ray" in (out := capsys.readouterr().out)
    assert ": leave out --radial-depth (certain)" in out
    street = dlama.read_rgbd(*STREET[:2], fov=90)
    np.save(tmp_path / "d.npy", street.depth * np.linalg.norm(rays(street.camera), axis=2))
    main(["doctor", STREET[0], str(tmp_path / "d.npy"), "--fov", "90", "--radial-depth"])


def test_json_has_the_findings(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["doctor", *STREET[:2], "--fov", "1.57", "--json"])
    reported = json.loads(capsys.readouterr().out)
    assert [each["check"] for each in reported["findings"]] == ["fov-radians", "understood"]
    assert set(reported["findings"][0]) == {"check", "severity", "confidence", "what", "mend"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([*STREET[:2], "--depth-range", "0"], "--depth-range is 0.0; a number > 0 is expected"),
        ([*STREET[:2], "--depth-scale", "-1"], "--depth-scale is -1.0; a number > 0 is expected"),
        (
            [*STREET[:2], "--depth-scale", "1", "--depth-range", "1"],
            "--depth-scale and --depth-range contradict each other",
        ),
        ([*STREET[:2], "--layout", "tum"], "--layout is tum; it does not apply to these inputs"),
        ([str(dlama.example()), "--fov", "90"], "--fov is 90.0; it does not apply to these inputs"),
        ([str(dlama.example()), "--soft-mask"], "--soft-mask is True; it does not apply to these inputs"),
    ],
)
def test_options_that_cannot_be_heeded_are_named(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Law: what is given is heeded or refused, in one line."""
    with pytest.raises(SystemExit):
        main(["doctor", *words])
    captured = capsys.readouterr()
    assert message in captured.out + captured.err


def test_a_depth_range_that_doctor_asks_for_is_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Law: with the option that the finding names, the finding is gone (EasySynth's depth without that in millimetres); a folder
    in which one is has its name, too."""
    frames = [frame(orbit(CAMERA, yaw)) for yaw in (0, 10)]
    write_scene(tmp_path, "walls", {"with": frames}, depth_range=10, classes=CLASSES)
    folder = tmp_path / "walls" / "with"
    shutil.rmtree(folder / "CameraComponent" / "DepthMM")
    with pytest.raises(SystemExit):
        main(["doctor", str(folder)])
    assert "give --depth-range METRES" in capsys.readouterr().out
    monkeypatch.chdir(folder)
    main(["doctor", ".", "--depth-range", "10"])
    assert "with: nothing wrong: layout easysynth" in capsys.readouterr().out
