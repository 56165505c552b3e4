"""`dlama batch` as a user meets it (oracles: lines by hand, the files that are there)."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import dlama
from dlama.apps.cli import main
from dlama.apps.terminal import output as terminal
from dlama.apps.terminal.streams import Stopped
from dlama.jobs.results.result import JobResult

LIST = """id,verb,image,depth,yaw,_note
a/1,view,image.png,depth.png,5,hello
a/2,view,image.png,depth.png,-5,
bad,view,nothing.png,depth.png,5,
"""
OPTIONS = ["--fov", "60", "--filler", "telea", "--only", "image", "--workers", "1"]


@pytest.fixture
def jobs(frame: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A list of three, one of them without its picture, in the working folder."""
    monkeypatch.chdir(frame)
    Path("jobs.csv").write_text(LIST)
    return "jobs.csv"


@pytest.mark.slow
def test_a_list_its_rerun_and_its_page(jobs: str, capsys: pytest.CaptureFixture[str]) -> None:
    """What is printed, exit code 1 for the bad row, what is kept the second time, and the page."""
    with pytest.raises(SystemExit) as stop:
        main(["batch", jobs, "-o", "out", *OPTIONS])
    reported = capsys.readouterr()
    assert stop.value.code == 1
    assert reported.err == f"error: bad: {Path.cwd()}/nothing.png: no such file\n"
    lines = reported.out.splitlines()
    assert lines[0] == "out:" and lines[1].split() == ["done", "2"]
    assert lines[2].split() == ["failed", "1:", "1", "FileError"]
    assert lines[-1].split() == ["rows", "out/manifest.csv"]
    assert sorted(path.name for path in Path("out/a/1").iterdir()) == ["image.png", "meta.json"]
    with pytest.raises(SystemExit):
        main(["batch", jobs, "-o", "out", "--json", "--quiet", *OPTIONS])
    found = json.loads(capsys.readouterr().out)
    counts = {name: found[name] for name in ("verb", "done", "kept", "failed", "failures")}
    assert counts == {"verb": "batch", "done": 2, "kept": 2, "failed": 1, "failures": {"FileError": 1}}
    main(["batch", "report", "out"])
    assert capsys.readouterr().out == "out/report.html\n"
    assert "no such file" in Path("out/report.html").read_text(encoding="utf-8")


def test_an_address_is_no_folder_here(jobs: str, capsys: pytest.CaptureFixture[str]) -> None:
    """-o memory://... goes to that file system, with both slashes, and file:// to its path (oracle: what lies there)."""
    memory = pytest.importorskip("fsspec").filesystem("memory")
    Path("bad.csv").write_text("id,verb\nbad,view\n")
    here = Path.cwd()
    for place, shown in (("memory://bucket/out", "memory://bucket/out"), (f"file://{here}/out", f"{here}/out")):
        with pytest.raises(SystemExit):
            main(["batch", "bad.csv", "-o", place, "--workers", "1"])
        assert capsys.readouterr().out.splitlines()[-1].split() == ["rows", f"{shown}/manifest.csv"]
    assert memory.exists("/bucket/out/manifest.csv") and Path("out/manifest.csv").is_file()
    assert not [path for path in here.iterdir() if path.name.endswith(":")]


def test_an_option_may_be_an_address(jobs: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A camera on a web server, with both slashes; a file of this computer stays one, file:// or not (oracle: what is typed)."""
    lines = list[str]()
    for camera in ("https://host/a/camera.json", "a/camera.json", "file:///a/camera.json"):
        main(["batch", jobs, "--camera", camera, "--dry-run"])
        lines.append(capsys.readouterr().out)
    for line, taken in zip(lines, ("https://host/a/camera.json", f"{Path.cwd()}/a/camera.json", "/a/camera.json")):
        assert f" camera={taken} " in line or f"{taken}: no such file" in line


def test_a_dry_run_runs_nothing(jobs: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The first jobs as they would run, defaults filled in; no folder is made."""
    main(["batch", jobs, "--dry-run", "--fov", "60", "--only", "image,depth"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "3 jobs (3 view), 1 of them cannot be run; the first ones:"
    assert lines[3] == f"  bad: view {Path.cwd()}/nothing.png: no such file"
    here = Path.cwd()
    assert lines[1] == f"  a/1: view fov=60 only=image,depth image={here}/image.png depth={here}/depth.png yaw=5"
    assert not Path("out").exists()
    main(["batch", "--images", "im*.png", "--depths", "depth.png", "--verb", "view", "--dry-run"])
    assert "1 of them cannot be run" in capsys.readouterr().out
    late = [{"id": str(number), "verb": "view", "image": "image.png"} for number in range(10)]
    late.append({"id": "last", "verb": "view", "image": "image.png", "filler": "glue"})
    Path("late.jsonl").write_text("\n".join(map(json.dumps, late)))
    main(["batch", "late.jsonl", "--dry-run"])
    last = capsys.readouterr().out.splitlines()[-2:]
    assert last[0] == "the first of the others that cannot be run:" and last[1].startswith(
        "  last: view late.jsonl: line 11: filler"
    )


def test_progress_and_ctrl_c(jobs: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a terminal lines come in time, with failures by kind; a signal says that nothing is lost."""

    def slow(*_: Any, progress: Any, **__: Any) -> Iterator[JobResult]:
        progress(None, 0, 10)
        row = JobResult("x", "failed", "view", "DepthError", "no depth")
        progress(row, 1, 10)
        yield row
        while "progress" not in (reported := capsys.readouterr().err):
            pass
        seen.append(reported)
        raise Stopped(signal.SIGINT)

    seen: list[str] = []
    monkeypatch.setattr(terminal, "MINUTE", 0.01)
    monkeypatch.setattr(dlama, "batch", slow)
    with pytest.raises(SystemExit) as stop:
        main(["batch", jobs, "-o", "out"])
    assert stop.value.code == 130
    assert "progress: batch: 1 of 10 done (10 %), " in seen[0] and "1 DepthError failed" in seen[0]
    assert "interrupted; what is done is kept, and the same command resumes it" in capsys.readouterr().err
