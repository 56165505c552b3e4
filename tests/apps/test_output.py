"""--quiet and --json (oracles: the files on disk, json, a pseudo terminal where one is needed)."""

from __future__ import annotations

import contextlib
import json
import re
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PIL import Image
from running import FAST, pixels, run

from dlama.apps.options import Report
from dlama.apps.terminal import bars
from dlama.apps.terminal import output as terminal
from dlama.apps.verbs.measuring import evaluating
from dlama.progress import begin_stage

VIEW = ("view", "image.png", "depth.png", "--fov", 60, "--yaw", 12, *FAST)


def test_quiet_prints_nothing(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Not even warnings; the result is written."""
    words = ("view", "image.png", "depth.png", "--fx", 55, "--cx", 90, "--cy", 24, "--yaw", 5, *FAST)
    out = run(frame, *words, "--quiet")
    assert capsys.readouterr() == ("", "")
    assert (out / "meta.json").is_file()


def test_a_bar_of_stages_is_full_at_the_end_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """By hand: five stages of about three; at the total the bar's clock would stop."""
    shown = list[int]()

    @contextlib.contextmanager
    def open_bar(*_: object) -> Iterator[Callable[..., None]]:
        yield lambda completed, description: shown.append(completed)

    monkeypatch.setattr(bars, "open_bar", open_bar)
    monkeypatch.setattr(terminal.sys.stderr, "isatty", lambda: True)
    with terminal.stages_bar("view", 3, Report()):
        for number in range(5):
            begin_stage(f"fill {number}")
    assert shown == [1, 2, 2, 2, 2]


def test_the_same_warning_is_printed_once(capsys: pytest.CaptureFixture[str]) -> None:
    """What is said of each frame of a folder; Python's own rule forgets what it has shown wherever filters change."""
    with terminal.report_result("view", Report(json=True)) as result:
        for number in range(4):
            with warnings.catch_warnings():
                warnings.warn("rgb: has 16 bits" if number < 3 else "rgb: is turned", UserWarning, stacklevel=1)
        result.add("done")
    shown = capsys.readouterr()
    assert shown.err == "warning: rgb: has 16 bits\nwarning: rgb: is turned\n"
    assert json.loads(shown.out)["warnings"] == ["rgb: has 16 bits", "rgb: is turned"]


def test_warnings_name_flags(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As errors do: the library's depth_scale is --depth-scale (oracle: the verb's --help)."""
    run(frame, "view", "image.png", "depth.png", "--fov", 60, "--yaw", 20, "--pivot", 2.5, "--depth-scale", 5000, *FAST)
    (reported,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: ")]
    assert "is unknown" in reported and "--depth-scale" in reported
    assert "depth_scale" not in reported


def test_json_is_one_object_of_what_was_done(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracles: the directory's listing, meta.json, the warning that is printed without --json too."""
    out = run(frame, "view", "image.png", "depth.png", "--fx", 55, "--cx", 90, "--yaw", 5, *FAST, "--json")
    shown = capsys.readouterr()
    done, meta = json.loads(shown.out), json.loads((out / "meta.json").read_text())
    assert shown.out.count("\n") == 1
    assert (done["verb"], done["output"], done["filler"], done["recipe"]) == ("view", str(out), "telea", "dlama")
    assert done["files"] == sorted(path.name for path in out.iterdir())
    assert done["hole_share_by_type"] == meta["hole_share_by_type"]
    assert done["seconds"] >= sum(done["seconds_by_stage"].values()) * 0.9
    assert len(done["warnings"]) == 1 and "principal point" in done["warnings"][0]
    assert shown.err == f"warning: {done['warnings'][0]}\n"
    run(frame, *VIEW, "--json", "--quiet")
    shown = capsys.readouterr()
    assert json.loads(shown.out)["warnings"] == [] and shown.err == ""


@pytest.mark.parametrize("words", [VIEW, ("photo3d", *VIEW[1:3], "--fov", 60, *FAST, "--only", "scene")])
def test_meta_json_has_how_depth_was_read(words: tuple[object, ...], frame: Path) -> None:
    """Oracle: the options as typed; nothing where none is."""
    assert "depth_reading" not in json.loads((run(frame, *words) / "meta.json").read_text())
    out = run(frame, *words, "--depth-scale", 900, "--far", 90, "--resize-depth", "nearest")
    given = {"depth_scale": 900, "far": 90, "resize_depth": "nearest"}
    assert json.loads((out / "meta.json").read_text())["depth_reading"] == given


def test_what_lacks_only_depth_is_no_unknown(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """5 x 8 pixels without depth next to the object (oracle: counted by hand in a picture of 64 x 48)."""
    depth = pixels(frame / "depth.png")
    depth[2:7, 2:10] = 0
    Image.fromarray(depth).save(frame / "depth.png")
    run(frame, "remove", "image.png", "depth.png", "mask.png", "--fov", 60, "--dilate", 0, *FAST)
    taken = (pixels(frame / "mask.png") == 255).mean()
    line = f"{taken:.1%} was unknown (object {taken:.1%}), {40 / (64 * 48):.1%} lacked only depth, filler telea"
    assert line in capsys.readouterr().out


def test_what_is_left_open_is_reported(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: pixels of depth.png that are 0."""
    out = run(frame, "remove", "image.png", "depth.png", "mask.png", "--fov", 60, "--min-confidence", 1, *FAST)
    left_open = (pixels(out / "depth.png") == 0).mean()
    assert left_open > 0.01 and f", {left_open:.1%} left open, filler telea" in capsys.readouterr().out


def test_a_line_a_minute(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a terminal long runs say how far they are, on standard error alone, and --quiet says nothing. Until something is
    done the line has the stage of the work, as frames of a scan are read for minutes."""
    monkeypatch.setattr(terminal, "MINUTE", 0.01)

    def heard(words: str) -> str:
        err = ""
        while words not in err:
            reported = capsys.readouterr()
            err += reported.err
            assert reported.out == ""
        return err

    with evaluating.show_progress("street", Report()) as progress:
        begin_stage("read frame 12 of 300")
        assert re.search(
            r"progress: street, read frame 12 of 300: 0 done, running for \d+ s\n", heard("12 of 300: 0 done, running")
        )
        progress(None, 2, 20)
        assert re.search(r"progress: street: 2 of 20 done \(10 %\), running for \d+ s\n", heard("2 of 20 done"))
    with evaluating.show_progress("street", Report(quiet=True)) as progress:
        progress(None, 2, 20)
        time.sleep(0.05)
    assert "2 of 20" not in capsys.readouterr().err
