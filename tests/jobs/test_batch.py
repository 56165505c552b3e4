"""Lists of jobs, run on processes (oracles: the verbs run alone, the list itself, files that are there or not)."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from small_jobs import FAST, InThisProcess, contents, table, view_rows, write_csv

import dlama
from box_frame import small_frame
from dlama.errors import InputError, OutputError
from dlama.jobs import batch as room
from dlama.jobs.batch import batch
from dlama.jobs.job import Job
from dlama.jobs.perform import Task, failed_row, work
from dlama.jobs.results.manifest import Manifest
from dlama.jobs.results.result import JobResult
from dlama.jobs.run import WINDOW, Settings, run_jobs
from dlama.jobs.storage import Output
from dlama.workers.pool import TaskEnd


@pytest.fixture(autouse=True)
def frame(tmp_path: Path) -> Path:
    """The folder of each test, with the small frame in it."""
    return small_frame(tmp_path)


def run(folder: Path, rows: list[dict[str, object]], **options: object) -> list[dlama.JobResult]:
    """The results of a list, written to folder/jobs.csv, in folder/out."""
    options = {**FAST, "workers": 1, "threads": 1} | options
    return list(batch(write_csv(folder / "jobs.csv", rows), folder / "out", **options))  # type: ignore[arg-type]


@pytest.mark.slow
def test_results_are_those_of_the_verbs(tmp_path: Path) -> None:
    """Oracle: view, remove and depth called one by one, byte for byte; a bad row is one failed row that says where it stands."""
    rows = [
        {"id": "a/1", "verb": "view", "image": "image.png", "depth": "depth.png", "yaw": 5},
        {"id": "missing", "verb": "view", "image": "nothing.png", "depth": "depth.png", "yaw": 5},
        {"id": "b", "verb": "remove", "image": "image.png", "depth": "depth.png", "mask": "mask.png"},
        {"id": "words", "verb": "view", "image": "image.png", "depth": "depth.png", "yaw": "five"},
        {"id": "c", "verb": "depth", "image": "image.png"},
        {"id": "still", "verb": "view", "image": "image.png", "depth": "depth.png"},
    ]
    results = {row.id: row for row in run(tmp_path, rows)}
    assert {name: row.status for name, row in results.items()} == {
        row["id"]: "done" if row["id"] in ("a/1", "b", "c") else "failed" for row in rows
    }
    rgbd = dlama.read_rgbd(tmp_path / "image.png", tmp_path / "depth.png", fov=60)
    alone = tmp_path / "alone"
    dlama.write(dlama.view(rgbd, yaw=5, filler="telea"), alone / "a" / "1", only=("image", "depth"))
    mask = dlama.read_mask(tmp_path / "mask.png")
    dlama.write(dlama.remove(rgbd, mask, filler="telea"), alone / "b", only=("image", "depth"))
    with pytest.warns(UserWarning, match="scale of the estimated depth is assumed"):
        dlama.write_depth(dlama.read_rgbd(tmp_path / "image.png", fov=60), alone / "c")
    mine, expected = contents(tmp_path / "out"), contents(alone)
    assert set(mine) == set(expected)
    assert [name for name in expected if mine[name] != expected[name] and not name.endswith("meta.json")] == []
    assert results["missing"].error == f"{tmp_path / 'nothing.png'}: no such file"
    assert results["words"].error == f"{tmp_path / 'jobs.csv'}: line 5: yaw is 'five'; a number is expected"
    assert "no camera move is given" in results["still"].error
    rows_written = table(tmp_path / "out")
    assert list(rows_written) == [row["id"] for row in rows]
    assert rows_written["a/1"]["hole_share"] == str(results["a/1"].hole_share) != ""
    assert rows_written["missing"]["error_kind"] == "FileError"


@pytest.mark.usefixtures("in_this_process")
def test_what_is_done_is_kept_and_what_changed_is_done_again(tmp_path: Path) -> None:
    """Oracle: which rows say that they were kept, after each change; a touched file of the same bytes is no change."""
    rows = view_rows(3)
    assert [row.kept for row in run(tmp_path, rows, ordered=True)] == [False] * 3
    assert [row.kept for row in run(tmp_path, rows, ordered=True)] == [True] * 3
    os.utime(tmp_path / "image.png")
    assert [row.kept for row in run(tmp_path, rows, ordered=True)] == [True] * 3
    rows[1]["yaw"] = 20
    assert [row.kept for row in run(tmp_path, rows, ordered=True)] == [True, False, True]
    assert [row.kept for row in run(tmp_path, rows, ordered=True, only="image")] == [False] * 3
    (tmp_path / "out" / "v" / "002" / "meta.json").unlink()
    (tmp_path / "out" / "v" / "002" / "image.png").unlink()
    (tmp_path / "out" / "v" / "002").rmdir()
    assert [row.kept for row in run(tmp_path, rows, ordered=True, only="image")] == [True, True, False]
    image = (tmp_path / "image.png").read_bytes()
    (tmp_path / "image.png").write_bytes((tmp_path / "mask.png").read_bytes())
    assert [row.kept for row in run(tmp_path, rows, ordered=True, only="image")] == [False] * 3
    (tmp_path / "image.png").write_bytes(image)
    assert [row.kept for row in run(tmp_path, rows, ordered=True, resume=False)] == [False] * 3
    assert len(table(tmp_path / "out")) == 3


class Backwards:
    """Workers of whom the one that was begun last ends first."""

    count = 20

    def __init__(self) -> None:
        self.tasks: list[Task] = []
        self.most = 0

    @property
    def free(self) -> int:
        return self.count - len(self.tasks)

    def submit(self, task: Task) -> None:
        self.tasks.append(task)
        self.most = max(self.most, task.number - self.tasks[0].number)

    def wait(self) -> list[TaskEnd]:
        task = self.tasks.pop()
        return [TaskEnd(task, JobResult(task.job.id, "done"))]

    def close(self) -> None:
        pass


def test_few_results_wait_for_a_slow_job(tmp_path: Path) -> None:
    """Oracle: the list, with a row that cannot be run; no job is begun WINDOW x workers after the one that is waited for, and
    none is forgotten."""
    jobs, workers = [Job(f"{number:03}", "view") for number in range(500)], Backwards()
    jobs[7] = replace(jobs[7], error="yaw is 'x'")
    settings = Settings(Output(str(tmp_path / "out")), ordered=True, resume=False)
    results = list(run_jobs(jobs, True, settings, lambda: workers))
    assert [row.id for row in results] == [job.id for job in jobs]
    assert workers.count < workers.most < WINDOW * workers.count


def test_a_job_that_kills_its_worker_twice_is_one_failed_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed once: done at the second try; twice: failed; everything else is done. (tests/workers has processes that die.)"""
    deaths = {"v/001": 1, "v/002": 9}
    monkeypatch.setattr(room, "worker_starter", lambda *_: lambda: InThisProcess(room.work, deaths))
    results = {row.id: row for row in run(tmp_path, view_rows(4))}
    assert {name: row.status for name, row in results.items()} == {
        "v/000": "done", "v/001": "done", "v/002": "failed", "v/003": "done",
    }  # fmt: skip
    assert results["v/001"].attempts == results["v/002"].attempts == 2
    assert results["v/002"].error_kind == "WorkerDied"
    assert "killed by SIGKILL" in results["v/002"].error


@pytest.mark.usefixtures("in_this_process")
def test_no_new_job_after_so_many_failures(tmp_path: Path) -> None:
    """One worker, the first three rows fail: with a limit of 2 no more than those and what was begun already come."""
    rows = [{**row, "image": "nothing.png"} for row in view_rows(3)] + view_rows(9)[3:]
    results = run(tmp_path, rows, stop_after_failures=2)
    assert [row.status for row in results].count("failed") == 2 and len(results) <= 3
    assert len(run(tmp_path, rows)) == 9


def test_lists_that_cannot_be_are_refused_before_anything_runs(tmp_path: Path) -> None:
    """Oracle: messages by hand; no result is there."""
    rows = view_rows(2)
    for change, message in (
        ({"id": "v/000"}, r"line 4: id 'v/000' is that of job 1 already"),
        ({"id": "v"}, r"id 'v' and id 'v/000': the folder of one would lie in the other's"),
        ({"id": "v/000/x"}, r"id 'v/000/x' and id 'v/000'"),
        ({"id": "../x"}, r"line 4: id is '../x'; a name that can be a folder"),
        ({"id": "manifest"}, r"are taken"),
        ({"id": ""}, r"line 4: id is missing"),
        ({"yaww": "3"}, r"line 1: column 'yaww' is no parameter; known are id, verb, image"),
    ):
        with pytest.raises(InputError, match=message):
            run(tmp_path, [*rows, {**rows[1], **change}])
        assert not (tmp_path / "out").exists()
    for options, message in (
        ({"workers": 0}, "workers is 0"),
        ({"threads": 0}, "threads is 0"),
        ({"stop_after_failures": 0}, "stop_after_failures is 0"),
        ({"verb": "vieww"}, "verb is 'vieww'"),
        ({"yaww": 3}, "yaww is no parameter of a verb"),
    ):
        with pytest.raises(InputError, match=message):
            run(tmp_path, rows, **options)


@pytest.mark.usefixtures("in_this_process")
def test_a_folder_that_is_no_result_is_never_replaced(tmp_path: Path) -> None:
    """Somebody's files stay, and the job is a failed row (oracle: the file)."""
    (tmp_path / "out" / "v" / "000").mkdir(parents=True)
    (tmp_path / "out" / "v" / "000" / "diary.txt").write_text("mine")
    results = {row.id: row for row in run(tmp_path, view_rows(2))}
    assert results["v/000"].error_kind == "OutputError" and results["v/001"].status == "done"
    assert (tmp_path / "out" / "v" / "000" / "diary.txt").read_text() == "mine"


@pytest.mark.usefixtures("in_this_process")
def test_two_runs_do_not_write_to_the_same_place(tmp_path: Path) -> None:
    """The second is refused while the first is under way."""
    pytest.importorskip("fcntl")
    first = batch(write_csv(tmp_path / "jobs.csv", view_rows(2)), tmp_path / "out", workers=1, **FAST)
    next(first)
    with pytest.raises(OutputError, match="another run is writing there"):
        run(tmp_path, view_rows(2))
    first.close()  # type: ignore[attr-defined]
    assert len(run(tmp_path, view_rows(2))) == 2


DRIVER = """
import sys
from pathlib import Path
from small_jobs import FAST
from dlama.jobs.batch import batch
if __name__ == "__main__":
    for row in batch(sys.argv[1], sys.argv[2], workers=1, threads=1, **FAST):
        print(row.id, flush=True)
"""


@pytest.mark.slow
@pytest.mark.usefixtures("in_this_process")
@pytest.mark.skipif(os.name == "nt", reason="no signals")
def test_a_killed_driver_loses_nothing(tmp_path: Path) -> None:
    """kill -9 in the middle: no worker outlives it; the next run keeps what was done and does the rest (oracle: the list)."""
    rows = view_rows(8)
    (tmp_path / "driver.py").write_text(DRIVER)
    words = [sys.executable, tmp_path / "driver.py", write_csv(tmp_path / "jobs.csv", rows), tmp_path / "out"]
    path = os.pathsep.join([*map(str, sys.path), os.environ.get("PYTHONPATH", "")])
    driver = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path})
    assert driver.stdout is not None
    seen = [driver.stdout.readline().strip() for _ in range(3)]
    driver.kill()
    driver.communicate()
    results: list[dlama.JobResult] = []
    for _ in range(6000):  # the lock goes when the last process that holds the file has ended
        try:
            results = run(tmp_path, rows)
            break
        except OutputError:
            time.sleep(0.1)
    assert {row.id for row in results} == {row["id"] for row in rows}
    assert set(seen) <= {row.id for row in results if row.kept}
    assert all(row.status == "done" for row in results)
    assert list(table(tmp_path / "out")) == [row["id"] for row in rows]
    assert not list((tmp_path / "out").glob(".dlama-*"))


@pytest.mark.usefixtures("in_this_process")
def test_rows_as_mappings_and_a_generator(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths start from the working folder; a generator is read once, and two equal ids are found as they come."""
    monkeypatch.chdir(tmp_path)
    rows = view_rows(3)
    results = list(batch(rows, "out", workers=1, **FAST))
    assert {row.status for row in results} == {"done"} and len(results) == 3
    assert all(row.kept for row in batch((row for row in rows), "out", workers=1, **FAST))
    with pytest.raises(InputError, match=r"job 4: id 'v/000' is that of job 1 already"):
        list(batch((row for row in [*rows, rows[0]]), "out", workers=1, **FAST))


@pytest.mark.usefixtures("in_this_process")
def test_a_run_that_can_write_nothing_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results that cannot be written, one after the other, end the run with the reason; later it resumes."""

    def full(task: Task) -> JobResult:
        return failed_row(task.job, OutputError("out: no space left on device"))

    with monkeypatch.context() as patched:
        patched.setattr(room, "worker_starter", lambda *_: lambda: InThisProcess(full))
        with pytest.raises(OutputError, match=r"no space left on device.*the same command resumes it"):
            run(tmp_path, view_rows(9))
    assert {row.status for row in run(tmp_path, view_rows(9))} == {"done"}


def test_a_full_disk_is_reported_with_the_result_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The message names where the file was to lie, not where it was made (oracle: by hand); no draft stays."""
    from dlama.files.rasters import pictures

    def full(path: Path, color: object) -> None:
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(pictures, "write_color", full)
    source = room.JobList(write_csv(tmp_path / "jobs.csv", view_rows(1)), None, FAST)
    row = work(Task(next(iter(source)), Output(str(tmp_path / "out"))))
    assert row.error == f"{tmp_path}/out/v/000/image.png: no space left on device"
    assert row.error_kind == "OutputError"
    assert list((tmp_path / "out").iterdir()) == []


def test_the_last_row_counts_also_where_the_clock_has_gone_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Law: of two rows of a job the later one counts, whatever the clock said (oracle: the order in which they were entered)."""
    clock = iter((2_000, 1_000))
    monkeypatch.setattr("dlama.jobs.results.manifest.time.time_ns", lambda: next(clock))
    for status in ("failed", "done"):
        with Manifest(Output(str(tmp_path))) as manifest:
            manifest.add(dlama.JobResult("a", status))  # type: ignore[arg-type]
    with Manifest(Output(str(tmp_path))) as manifest:
        assert manifest.find("a").status == "done"  # type: ignore[union-attr]


@pytest.mark.usefixtures("in_this_process")
def test_options_that_cannot_be_are_one_failed_row_without_work(tmp_path: Path) -> None:
    """All that is wrong in one row is said at once, before a picture is read; an id that is no text is refused."""
    base = {"id": "a", "verb": "view", "image": "image.png", "depth": "depth.png", "yaw": 5}
    (row,) = run(tmp_path, [{**base, "seed": -1, "dilate": -2, "min_confidence": 3}])
    assert row.status == "failed" and row.seconds_by_stage == {}
    assert all(word in row.error for word in ("seed is -1", "dilate is -2", "min_confidence is 3.0"))
    with pytest.raises(InputError, match="a name that can be a folder"):
        list(batch([{**base, "id": "a\udcff"}], tmp_path / "out", **FAST))
