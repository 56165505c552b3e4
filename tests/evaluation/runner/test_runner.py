"""Runs on made-up cases (oracles: the runs a protocol has logged, the bytes of files, tables written by hand)."""

from __future__ import annotations

import csv
import dataclasses
import functools
import json
import os
from pathlib import Path

import made_up
import numpy as np
import pytest
from made_up import METHODS, made_up_dataset

from dlama.datasets.frames import Dataset
from dlama.errors import InputError, OutputError
from dlama.evaluation.protocols import vpi
from dlama.evaluation.protocols.methods import Method, ProtocolSettings
from dlama.evaluation.runner import cache_key
from dlama.evaluation.runner.run import Results, run
from dlama.evaluation.runner.store import Row, read_stored, stem, write_rows
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.pictures import read_color

SETTINGS = ProtocolSettings()


def evaluated(dataset: Dataset, folder: Path, *methods: Method, jobs: int = 1, settings: object = SETTINGS) -> Results:
    """A run with the made-up protocol for everything."""
    protocols = dict.fromkeys(("vpi", "ori", "sii"), made_up.protocol)
    return run(dataset.cases, methods or METHODS, protocols, settings, folder, jobs=jobs)  # type: ignore[arg-type]


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file with a line (method, process, threads) for every run of the protocol."""
    monkeypatch.setenv(made_up.LOG, str(tmp_path / "log.txt"))
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    (tmp_path / "log.txt").touch()
    return tmp_path / "log.txt"


def lines(log: Path) -> int:
    """How often the protocol ran since the last time."""
    count = len(log.read_text().splitlines())
    log.write_text("")
    return count


def rows_of(done: Results) -> list[Row]:
    """All numbers that are the same on every run."""
    return [row for one in done.stored for row in one.rows]


def written(folder: Path, done: Results) -> bytes:
    """results.csv of a run."""
    write_rows(folder / "results.csv", rows_of(done))
    return (folder / "results.csv").read_bytes()


def test_every_case_meets_every_method_in_order_and_a_second_run_does_nothing(tmp_path: Path, log: Path) -> None:
    """Oracles: the product of cases and methods, two runs each (the second a variant); the log is empty; results.csv equal."""
    dataset = made_up_dataset(2, (10.0, -10.0))
    done = evaluated(dataset, tmp_path / "a")
    met = [(one.rows[0].scene, one.rows[0].frame, one.rows[0].method) for one in done.stored]
    assert met == [(case.scene, case.frame, method.label) for case in dataset.cases for method in METHODS]
    assert {row.recipe.partition("+")[2] for row in rows_of(done)} == {"", "object,dilate=3"}
    assert done.failures == () and done.reused == 0
    first = written(tmp_path, done)
    assert lines(log) == 4 * 6
    again = evaluated(dataset, tmp_path / "a")
    assert lines(log) == 0 and again.reused == 24
    assert written(tmp_path, again) == first
    assert written(tmp_path, evaluated(dataset, tmp_path / "b")) == first


def test_csv_has_the_header_and_every_digit(tmp_path: Path) -> None:
    """Oracles: the stated header; the protocol's own numbers, read back equal; variants joined with a +."""
    done = evaluated(made_up_dataset(1, (10.0, None)), tmp_path, Method("dlama", "telea"))
    text = written(tmp_path, done).decode()
    assert (
        text.splitlines()[0]
        == "protocol,dataset,scene,frame,yaw,recipe,filler,region,modality,metric,value"
        == ",".join(Row._fields)
    )
    assert ",10,dlama,telea,whole,rgb,ssim," in text and ",,dlama,telea,whole,rgb,ssim," in text
    assert ',"dlama+object,dilate=3",telea,' in text
    assert "outside,rgb,psnr,inf" in text
    assert "time" not in text and "memory" not in text
    scored = made_up.protocol(made_up.truth(0), Method("dlama", "telea"), SETTINGS)
    expected = [measure for one in scored for measure in one.measures if measure.modality != "time"]
    _, *lines = csv.reader((tmp_path / "results.csv").read_text("utf-8").splitlines())
    rows = [Row(*line[:4], float(line[4]) if line[4] else None, *line[5:10], float(line[10])) for line in lines]
    assert [row[7:] for row in rows if row.yaw == 10] == [tuple(one) for one in expected]
    assert rows == rows_of(done)


def test_timings_stand_apart(tmp_path: Path) -> None:
    """Oracle: the protocol's own 0.25 s go first; memory is that of a process that has loaded numpy."""
    done = evaluated(made_up_dataset(1, (10.0,)), tmp_path, Method("dlama", "telea"))
    values = {(row.modality, row.metric): row.value for row in done.stored[0].timings}
    assert values["time", "seconds"] == 0.25
    assert values["time", "seconds_scored"] > 0
    assert 10 < values["memory", "peak_mib"] < 16_000


def test_only_what_is_missing_or_stale_is_done(tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the number of runs after each change."""
    dataset, method = made_up_dataset(), Method("dlama", "telea")
    evaluated(dataset, tmp_path, method)
    assert lines(log) == 12
    names = [stem(case, method) for case in dataset.cases]
    (tmp_path / "cases" / f"{names[0]}.json").unlink()
    (tmp_path / "cases" / f"{names[1]}.json").write_text('{"cache_key": "half of a fi')
    (tmp_path / "panels" / f"{names[2]}--0.jpg").unlink()
    evaluated(dataset, tmp_path, method)
    assert lines(log) == 3
    evaluated(dataset, tmp_path, method, Method("dlama", "layered"))
    assert lines(log) == 12
    again = evaluated(dataset, tmp_path, dataclasses.replace(method, seed=1))
    assert lines(log) == 12 and (again.reused, again.stale) == (0, 12)
    evaluated(dataset, tmp_path, method, settings=ProtocolSettings(ring_px=3))
    assert lines(log) == 12
    monkeypatch.setattr(cache_key, "code_hash", lambda: "another version")
    evaluated(dataset, tmp_path, method)
    assert lines(log) == 12


def test_one_bad_frame_does_not_stop_the_rest(tmp_path: Path) -> None:
    """Oracles: the errors by hand; everything else is there; mended, only the bad ones run, and no error is left."""
    whole = made_up_dataset(1)
    bad = dataclasses.replace(whole.cases[1], load=functools.partial(made_up.bad_truth, 7))
    broken = dataclasses.replace(whole, cases=(whole.cases[0], bad, *whole.cases[2:]))
    done = evaluated(broken, tmp_path, Method("dlama", "telea"), Method("paper", "bad"))
    assert len(done.stored) == 5 and len(done.failures) == 7
    entries = json.loads((tmp_path / "errors.json").read_text())
    assert entries[1] | {"traceback": ""} == {
        "protocol": "vpi",
        "scene": "s0",
        "frame": "-10",
        "method": "dlama/telea",
        "error": "ValueError: frame 7 is broken, so it is",
        "traceback": "",
    }
    assert "in bad_truth" in (tmp_path / entries[1]["traceback"]).read_text()
    assert entries[0]["error"] == "RuntimeError: no such luck with paper"
    mended = evaluated(whole, tmp_path, Method("dlama", "telea"))
    assert mended.reused == 5 and mended.failures == ()
    assert not (tmp_path / "errors.json").exists() and not (tmp_path / "errors").exists()


@pytest.mark.slow
def test_two_processes_give_the_same_bytes(tmp_path: Path, log: Path) -> None:
    """Oracles: one process's results; the log says that others did it, each with one thread; failures travel back."""
    dataset = made_up_dataset(2, (10.0, -10.0))
    methods = (Method("dlama", "telea"), Method("dlama", "bad"))
    single = evaluated(dataset, tmp_path / "a", *methods)
    log.write_text("")
    double = evaluated(dataset, tmp_path / "b", *methods, jobs=2)
    logged = [line.split() for line in log.read_text().splitlines()]
    assert len(logged) == 8 and str(os.getpid()) not in {process for _, process, _ in logged}
    assert {threads for _, _, threads in logged} == {"1"}
    assert written(tmp_path, double) == written(tmp_path, single)
    assert [one.error for one in double.failures] == [one.error for one in single.failures]
    assert "in protocol" in double.failures[0].trace


@pytest.mark.slow
def test_a_process_that_dies_takes_only_its_case(tmp_path: Path) -> None:
    """Oracle: one case kills its process; it fails and nothing else, for what was under way next to it is run again."""
    whole = made_up_dataset(1)
    deadly = dataclasses.replace(whole.cases[0], load=functools.partial(os._exit, 3))
    done = evaluated(
        dataclasses.replace(whole, cases=(deadly, *whole.cases[1:])), tmp_path, Method("dlama", "telea"), jobs=2
    )
    assert done.failures[0].case.frame == "+10" and "process died" in str(done.failures[0].error)
    assert len(done.failures) == 1 and len(done.stored) == 5


def test_pictures_are_kept_where_they_are_asked_for(tmp_path: Path) -> None:
    """Closed form: from the source's own camera the completed picture is the source, in every bit of colour and depth; one
    that is missing is made again."""
    cases, methods = made_up_dataset(scenes=1).cases[:1], [Method("dlama", "telea")]
    settings = ProtocolSettings(object_dilations=(), lpips=False)

    def again(pictures: bool, settings: ProtocolSettings = settings) -> int:
        return run(cases, methods, {"vpi": vpi.score}, settings, tmp_path, pictures=pictures).reused

    assert again(False) == 0 and not (tmp_path / "pictures").exists()
    assert again(True) == 0
    source, place = made_up.truth(0).source, tmp_path / "pictures" / stem(cases[0], methods[0])
    np.testing.assert_array_equal(read_color(place.with_name(f"{place.name}.png")), source.color)
    np.testing.assert_array_equal(read_depth(place.with_name(f"{place.name}.exr")), source.depth)
    assert again(True) == again(False) == 1
    place.with_name(f"{place.name}.png").unlink()
    assert again(False) == 1 and again(True) == 0 and place.with_name(f"{place.name}.png").is_file()
    other = dataclasses.replace(settings, smallest_region=settings.smallest_region + 1)
    assert again(False, other) == 0 and not any(place.parent.iterdir())  # they were those of the settings before
    assert again(True, other) == 0


def test_an_interrupted_run_keeps_what_is_done(tmp_path: Path, log: Path) -> None:
    """Oracle: Ctrl-C after five results; the next run does the other seven."""
    dataset = made_up_dataset()

    def stop(outcome: object, done: int, total: int) -> None:
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(dataset.cases, METHODS[:1], {"vpi": made_up.protocol}, SETTINGS, tmp_path, progress=stop)
    assert lines(log) == 5
    assert evaluated(dataset, tmp_path, METHODS[0]).reused == 5
    assert lines(log) == 7
    assert not list(tmp_path.rglob(".*"))


def test_what_cannot_be_run_is_refused(tmp_path: Path) -> None:
    """Two cases or methods of one name, nothing at all, no processes, a file where the folder should be."""
    dataset = made_up_dataset(1)
    twice = dataclasses.replace(dataset, cases=(*dataset.cases, dataset.cases[0]))
    with pytest.raises(InputError, match="two cases are called vpi__toy__s0"):
        evaluated(twice, tmp_path)
    with pytest.raises(InputError, match="two methods are called dlama/telea"):
        evaluated(dataset, tmp_path, Method("dlama", "telea"), Method("dlama", "telea", seed=1))
    with pytest.raises(InputError, match="0 cases"):
        evaluated(dataclasses.replace(dataset, cases=()), tmp_path)
    with pytest.raises(InputError, match="jobs is 0"):
        evaluated(dataset, tmp_path, jobs=0)
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file: cannot be written"):
        evaluated(dataset, tmp_path / "file")


def test_names_are_safe_and_short() -> None:
    """Oracle: 255 bytes with a suffix, no separator; different cases keep different names, also where they differ in signs that a
    file's name does not take or that have several bytes."""
    case, method = made_up_dataset(1).cases[0], Method("dlama", "telea")
    frames = (
        *(f"{'x' * 300}{tail}" for tail in "ab"),
        *("a b", "a_b", "a/b", "a:b"),
        *("部屋" * 40 + tail for tail in ("", "の")),
    )
    names = [stem(dataclasses.replace(case, frame=frame), method) for frame in frames]
    assert len(set(names)) == len(frames)
    assert all(len(name.encode()) < 200 and not set("/: ") & set(name) for name in names)


def test_a_damaged_store_counts_as_absent(tmp_path: Path) -> None:
    """Whatever a crash may leave."""
    for text in ("", "[]", "{}", '{"rows": 3}', "\x00", "[" * 100_000, '{"rows": [3]}'):
        (tmp_path / "a.json").write_text(text)
        assert read_stored(tmp_path / "a.json") is None
    assert read_stored(tmp_path / "no.json") is None
