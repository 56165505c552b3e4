"""`dlama doctor` as people run it (oracle: the bundled street scene, good and wrongly read)."""

from __future__ import annotations

import json

import pytest

import dlama
from dlama.apps.cli import main

STREET = [str(dlama.example() / name) for name in ("street.jpg", "depth.png", "mask.png")]


def test_good_inputs_get_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    main(["doctor", *STREET, "--fov", "90"])
    captured = capsys.readouterr()
    assert captured.err == "" and captured.out.count("\n") == 1 and "nothing wrong: 512x512" in captured.out


def test_faults_name_flags_and_end_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    words = [*STREET, "--fov", "1.57", "--depth-scale", "200", "--mask-polarity", "known"]
    with pytest.raises(SystemExit) as stop:
        main(["doctor", *words])
    lines = capsys.readouterr().out.splitlines()
    assert stop.value.code == 1 and len(lines) == 4
    for line, flag in zip(lines, ("give --fov 89.95 (sure)", "give --depth-scale 1000 (sure)", "--mask-polarity")):
        assert flag in line


def test_json_has_the_findings(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["doctor", *STREET[:2], "--fov", "1.57", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert [each["check"] for each in told["findings"]] == ["fov-radians", "understood"]
    assert set(told["findings"][0]) == {"check", "severity", "sure", "what", "mend"}
