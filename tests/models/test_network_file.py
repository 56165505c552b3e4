"""Network files, opened to run (oracle: closed forms of tiny networks), and the contracts in them (round trips, messages)."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from dlama.errors import FileError, InputError
from dlama.models.contracts import CONTRACT_KEY, ColorContract
from dlama.models.network_file import LARGE, PROVIDERS, NetworkFile, make_room, open_kept
from dlama.models.verify import PIECE
from tiny_networks import constant


def test_what_is_in_the_file_and_what_it_gives(tmp_path: Path) -> None:
    """Closed form: a network of four planes in and three constants out."""
    model = NetworkFile(constant(tmp_path / "c.onnx", 3, 0.1, 0.2, 0.3))
    assert list(model.inputs) == ["planes"] and model.inputs["planes"][0] == "tensor(float)"
    assert list(model.outputs) == ["filled"] and model.outputs["filled"][1][1] == 3
    assert "dlama.contract" in model.metadata
    fed = {"planes": np.zeros((1, 4, 5, 6), np.float32)}
    expected = np.broadcast_to(np.float32([0.1, 0.2, 0.3])[:, None, None], (1, 3, 5, 6))
    np.testing.assert_array_equal(model.run(fed), expected)
    assert len(model.run_all(fed)) == 1
    assert model.notes["model"] == "c.onnx" and model.notes["provider"] in PROVIDERS


def test_nothing_is_kept_for_or_sent_to_the_makers_of_the_runtime(tmp_path: Path) -> None:
    """Law: a run leaves no file at home (what ONNX Runtime has to report from 1.29 on lies in ~/.cache until it is sent)."""
    model, home = constant(tmp_path / "c.onnx", 3, 0.1, 0.2, 0.3), tmp_path / "home"
    home.mkdir()
    code = "import pathlib, sys; from dlama.models import network_file as f; f.NetworkFile(pathlib.Path(sys.argv[1])).session"
    unset = ("CI", "GITHUB_ACTIONS", "XDG_CACHE_HOME", "ORT_DISABLE_TELEMETRY")
    environment = {name: value for name, value in os.environ.items() if name not in unset} | {"HOME": str(home)}
    subprocess.run([sys.executable, "-c", code, str(model)], env=environment, check=True)
    assert list(home.rglob("*")) == []


def test_sessions_close_for_large_pictures_and_open_again(tmp_path: Path) -> None:
    """Law: a small picture leaves them open; after a large one a network opens anew and says the same."""
    model = NetworkFile(constant(tmp_path / "c.onnx", 3, 0.1, 0.2, 0.3))
    fed = {"planes": np.zeros((1, 4, 5, 6), np.float32)}
    before, session = model.run(fed), model.session
    make_room(LARGE)
    assert model.session is session
    make_room(LARGE + 1)
    np.testing.assert_array_equal(model.run(fed), before)
    assert model.session is not session


def test_the_hash_is_of_the_whole_file(tmp_path: Path) -> None:
    """Oracle: hashlib on a file of several pieces, of which only the last byte differs."""
    content = bytes(3 * PIECE + 7)
    for number in range(2):
        path = tmp_path / f"{number}.onnx"
        path.write_bytes(content + bytes([number]))
        assert NetworkFile(path).sha256 == hashlib.sha256(content + bytes([number])).hexdigest()


def test_bad_files_and_settings_are_refused(tmp_path: Path) -> None:
    """Law: one line that names the file, or the parameter."""
    good = constant(tmp_path / "c.onnx", 3, 0.1, 0.2, 0.3)
    (tmp_path / "text.onnx").write_text("no network")
    (tmp_path / "empty.onnx").touch()
    three = {"planes": np.zeros((1, 3, 5, 6), np.float32)}
    calls: list[tuple[Callable[[], object], str]] = [
        (lambda: open_kept(NetworkFile, tmp_path / "empty.onnx"), r"empty\.onnx: is empty \(0 bytes\)"),
        (lambda: NetworkFile(tmp_path / "none.onnx"), r"none\.onnx: no such model file"),
        (lambda: open_kept(NetworkFile, tmp_path / "none.onnx"), r"none\.onnx: no such model file"),
        (lambda: NetworkFile(tmp_path / "text.onnx").session, r"text\.onnx: cannot be opened .*dlama models convert"),
        (lambda: NetworkFile(good).run(three), r"c\.onnx: failed on .*'planes': \(1, 3, 5, 6\)"),
        (lambda: NetworkFile(good, provider="tpu"), "provider is 'tpu'; one of cuda"),
        (lambda: NetworkFile(good, threads=0), "threads is 0"),
    ]
    for call, words in calls:
        with pytest.raises((FileError, InputError), match=words):
            call()


def test_omp_num_threads_is_obeyed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: as other libraries do; nonsense is not, and a number in the code goes first."""
    model = constant(tmp_path / "c.onnx", 3, 0.2, 0.2, 0.2)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert NetworkFile(model).threads == 3 and NetworkFile(model, threads=1).threads == 1
    for nonsense in ("", "0", "many"):
        monkeypatch.setenv("OMP_NUM_THREADS", nonsense)
        assert NetworkFile(model).threads == len(os.sched_getaffinity(0))


@dataclass(frozen=True)
class Sizes(ColorContract):
    """A contract."""

    network = "sizes"
    side: int = 1
    pair: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self.side < 1:
            raise InputError("contract: side of 1 or more is expected")


def test_a_contract_comes_back_as_it_was_written() -> None:
    """Tuples included, which JSON does not have."""
    written = Sizes(7, (0.5, 2.0)).metadata()
    assert Sizes.read(written[CONTRACT_KEY], Path("n.onnx")) == Sizes(7, (0.5, 2.0))


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"network": "sizes", "side": "a"}', '{"network": "sizes", "side": 0}', "[" * 100_000]
)
def test_what_is_no_contract_is_an_error_of_the_file(text: str) -> None:
    """Not JSON, no table, values of another type or out of range, lists nested deeper than Python reads."""
    with pytest.raises(FileError, match=r"^n\.onnx: "):
        Sizes.read(text, Path("n.onnx"))


def test_unknown_fields_are_refused() -> None:
    """Law: what a user wrote wrong is not passed over; of a version nothing depends."""
    assert Sizes.read('{"network": "sizes", "version": 3}', Path("n.onnx")) == Sizes()
    with pytest.raises(FileError, match=r"n\.onnx: its contract has sides; known are mean, pair, scale, side, std"):
        Sizes.read('{"network": "sizes", "sides": 2}', Path("n.onnx"))


def test_a_network_stays_open_until_its_file_or_the_cores_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Law: the same one for the same file; another one for other bytes under the name, and for another number of cores."""
    path = constant(tmp_path / "c.onnx", 3, 0.1, 0.2, 0.3)
    first = open_kept(NetworkFile, path)
    assert open_kept(NetworkFile, path) is first
    assert open_kept(NetworkFile, constant(path, 3, 0.1, 0.2, 0.25)) is not first
    second = open_kept(NetworkFile, path)
    monkeypatch.setenv("OMP_NUM_THREADS", str(second.threads + 1))
    assert open_kept(NetworkFile, path).threads == second.threads + 1
