"""`dlama evaluate` and `dlama worlds`, in this process on a world of 64 px (oracles: lists of options and columns, csv)."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import re
from pathlib import Path

import pytest
from running import refused

from dlama.apps.cli import main
from dlama.apps.options import Report
from dlama.apps.verbs.measuring import evaluate as verb
from dlama.apps.verbs.measuring.evaluating import choose_cases, command_line
from dlama.apps.verbs.measuring.options import Cases, Methods
from dlama.datasets.frames import Case, Dataset
from dlama.errors import InputError, MissingExtraError
from dlama.evaluation import protocols
from dlama.evaluation.protocols.methods import Method, ProtocolSettings, Scored
from dlama.evaluation.report.write import FILES

HEADER = "protocol,dataset,scene,frame,yaw,recipe,filler,region,modality,metric,value"


@pytest.fixture(scope="module")
def small_worlds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`dlama worlds` with one scene of 64 px; its --json says where it lies (oracle: the disk)."""
    folder, shown = tmp_path_factory.mktemp("worlds") / "made", io.StringIO()
    words = ["--count", "1", "--size", "64", "--kind", "street", "--seed", "3", "--json"]
    with contextlib.redirect_stdout(shown):
        main(["worlds", "-o", str(folder), *words])
    reported = json.loads(shown.getvalue())
    assert (reported["verb"], reported["output"], len(reported["scenes"])) == ("worlds", str(folder), 1)
    assert all(Path(scene).is_dir() for scene in reported["scenes"])
    return folder


def evaluated(folder: Path, out: Path, *words: str) -> list[dict[str, str]]:
    """`dlama evaluate FOLDER WORDS -o OUT`; the rows of results.csv."""
    main(["evaluate", str(folder), *words, "-o", str(out)])
    with (out / "results.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.slow
def test_worlds_say_what_to_do_next(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracles: the command that is printed, run as it stands; of its --json the disk."""
    main(["worlds", "-o", str(tmp_path / "made"), "--count", "1", "--size", "48"])
    place, _, command = capsys.readouterr().out.strip().partition(": 1 scene. Next: ")
    assert place == str(tmp_path / "made") and command.startswith(f"dlama evaluate {place} ")
    words = command.split()[1:-1]
    main([*words, str(tmp_path / "out"), "--protocol", "sii", "--fillers", "none", "--recipes", "paper", "--json"])
    done = json.loads(capsys.readouterr().out)
    assert done["report"] == str(tmp_path / "out" / "report.html") and Path(done["report"]).is_file()
    assert (done["verb"], done["failed"]) == ("evaluate", 0) and done["results"] > 0


@pytest.mark.slow
def test_evaluate_end_to_end(small_worlds: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracles: the header, regions and modalities; every recipe with every filler; a second run does nothing."""
    cases = ["--protocol", "vpi", "ori", "sii", "--yaws", "20", "--limit", "2"]
    words = [*cases, "--fillers", "telea", "none", "--no-variants"]
    rows = evaluated(small_worlds, tmp_path / "out", *words)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*FILES, "cases", "panels"}
    first = (tmp_path / "out" / "results.csv").read_bytes()
    assert first.splitlines()[0].decode() == HEADER
    assert {(row["recipe"], row["filler"]) for row in rows} == {
        (r, f) for r in ("dlama", "paper") for f in ("telea", "none")
    }
    assert {row["yaw"] for row in rows if row["protocol"] == "vpi"} == {"20", "-20"}
    assert {row["protocol"] for row in rows} == {"vpi", "ori", "sii"}
    assert {"whole", "seen", "unseen", "mask", "outside"} <= {row["region"] for row in rows}
    assert {"rgb", "depth", "depth_m"} <= {row["modality"] for row in rows}
    assert not {"time", "memory"} & {row["modality"] for row in rows}
    assert "results" in capsys.readouterr().out
    evaluated(small_worlds, tmp_path / "out", *words)
    assert re.search(r"report\.html: (\d+) results \(\1 from an earlier run\)\n", capsys.readouterr().out)
    assert (tmp_path / "out" / "results.csv").read_bytes() == first


def test_a_failure_is_reported_and_exits_with_1(
    small_worlds: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One filler fails on every case; the other's results are all there; one line each, and errors.json."""

    def sometimes(truth: object, method: Method, settings: ProtocolSettings) -> list[Scored]:
        if method.filler == "telea":
            raise ZeroDivisionError("on purpose")
        return [Scored(())]

    monkeypatch.setitem(protocols.PROTOCOLS, "vpi", sometimes)
    words = ["--protocol", "vpi", "--yaws", "30", "--recipes", "dlama", "--fillers", "none", "telea"]
    with pytest.raises(SystemExit) as stop:
        main(["evaluate", str(small_worlds), *words, "-o", str(tmp_path)])
    reported = capsys.readouterr()
    assert stop.value.code == 1
    assert re.fullmatch(r"(error: vpi \S+ \S+, dlama/telea: ZeroDivisionError: on purpose\n){2}", reported.err)
    assert "2 results, 2 failed" in reported.out and "errors.json" in reported.out
    assert len(json.loads((tmp_path / "errors.json").read_text())) == 2


def test_bad_words_are_refused_before_anything_runs(
    small_worlds: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each names the option and what is expected; nothing is written."""
    expected = {
        ("--fillers", "lama"): "filler 'lama' runs a network: --model lama=FILE is expected",
        ("--fillers", "best"): "--fillers is 'best'; one of none, layered",
        ("--recipes", "best"): "--recipes is 'best'; one of dlama, paper",
        ("--model", "lama"): "--model is 'lama'; FILLER=FILE is expected",
        ("--model", "telea=a.onnx"): "FILLER one of layered-patches, lama, migan, patchmatch, joint",
        ("--model", "lama=a.onnx"): "lama is not among --fillers",
        ("--fillers", "lama", "--model", "lama=no.onnx"): "no.onnx: no such file",
        ("--protocol", "vpi", "--yaws", "15"): "no case is left of made; its yaws are ±10, ±20",
        ("--scenes", "nowhere"): "'nowhere' is not in this data set",
        ("--jobs", "0"): "jobs is 0",
    }
    for words, line in expected.items():
        assert line in refused(capsys, tmp_path, "evaluate", small_worlds, *words), words
    assert "no such folder" in refused(capsys, tmp_path, "evaluate", tmp_path / "no")


def test_a_data_set_without_a_protocol_says_so() -> None:
    """Removal asked of view changes."""
    cases = (Case("vpi", "toy", "s", "f", lambda: None, 10.0),)  # type: ignore[arg-type,return-value]
    with pytest.raises(InputError, match="toy has no cases of ori; it has vpi"):
        choose_cases(Dataset("toy", "made-up", None, (), cases), Cases(protocol=("ori",)))


def test_yaws_are_asked_for_by_the_names_that_the_report_gives() -> None:
    """Oracle: the labels of the tables. Of pairs ≈30 is from 25 to 35 degrees; of an orbit 30 is 30."""

    def chosen(yaws: tuple[float, ...], expected: float) -> list[float | None]:
        cases = tuple(Case("vpi", "toy", "s", "f", lambda: None, yaw) for yaw in yaws)  # type: ignore[arg-type,return-value]
        return [case.yaw for case in choose_cases(Dataset("toy", "made-up", None, (), cases), Cases(yaws=(expected,)))]

    pairs, orbit = (9.9, 31.8, -28.2, 38.7), (10.0, 25.0, 30.0, -30.0)
    assert chosen(pairs, 30) == [31.8, -28.2] and chosen(pairs, -38.7) == [38.7]
    assert chosen(orbit, 30) == [30.0, -30.0]
    with pytest.raises(InputError, match=r"no case is left of toy; its yaws are ≈10, ≈30, ≈40$"):
        chosen(pairs, 90)


def test_the_command_is_repeatable() -> None:
    """What differs from the defaults, as it was typed, to the last digit."""
    cases, methods = (
        Cases(("vpi",), yaws=(10.0, 20.0), depth_range=10.0625078),
        Methods(fillers=("telea",), variants=False),
    )
    assert command_line("a b", Path("out"), Cases(), Methods()) == "dlama evaluate 'a b' -o out"
    assert command_line("street", Path("out"), cases, methods) == (
        "dlama evaluate street --protocol vpi --yaws 10 20 --depth-range 10.0625078 --fillers telea --no-variants -o out"
    )


def test_a_missing_extra_is_named_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the pip line."""
    monkeypatch.setattr(verb, "NEEDED", {"jinja2": "no_such_module"})
    with pytest.raises(MissingExtraError, match=r"needs the package 'jinja2': pip install 'dlama\[evaluate\]'"):
        verb.evaluate("worlds", Path("out"), Cases(), Methods(), Report())
