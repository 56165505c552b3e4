"""`dlama models` as a user meets it (oracle: files whose content the test itself made, and the exit code)."""

from __future__ import annotations

import dataclasses
import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from running import error_line

from dlama.apps import cli
from dlama.apps.model_files import model_for
from dlama.errors import FileError, InputError
from dlama.models.records import CATALOGUE
from dlama.nets.architecture import GeneratorSettings, generator_shapes
from dlama.nets.safetensors_file import write_safetensors

SMALL = GeneratorSettings(width=4, blocks=1, downsamplings=2)


def write_weights(path: Path, half: bool = False) -> Path:
    """A small generator of random weights as safetensors."""
    rng, tensors = np.random.default_rng(0), dict[str, np.ndarray]()
    for name, shape in generator_shapes(SMALL).items():
        kind = "i8" if name.endswith("num_batches_tracked") else "f2" if half and name.endswith(".bias") else "f4"
        tensors[name] = np.asarray(rng.uniform(0.5, 1.0, shape), kind)
    write_safetensors(path, tensors)
    return path


@pytest.fixture(autouse=True)
def cache_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache directory."""
    monkeypatch.setenv("DLAMA_MODELS", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_json_says_what_the_lines_say(capsys: pytest.CaptureFixture[str], cache_dir: Path) -> None:
    """Oracle: the catalogue; one object a command, nothing else on standard output; --quiet prints nothing."""
    cache_dir.mkdir()
    name = "big-lama"
    (cache_dir / CATALOGUE[name].file).write_bytes(b"too short")
    said = {}
    for words in (["list"], ["info", name]):
        cli.main(["models", *words, "--json"])
        said[words[0]] = json.loads(capsys.readouterr().out)
        cli.main(["models", *words, "--quiet"])
        assert capsys.readouterr() == ("", "")
    table = {entry["name"]: entry for entry in said["list"]["models"]}
    assert set(table) == set(CATALOGUE) and said["list"]["directory"] == str(cache_dir)
    assert table[name]["here"] and table[name]["licence"] == CATALOGUE[name].licence
    assert said["info"]["name"] == name and said["info"]["urls"] == list(CATALOGUE[name].urls)
    error_line(capsys, "models", "verify", name, "--json")


def test_list_and_info(capsys: pytest.CaptureFixture[str], cache_dir: Path) -> None:
    """Every name stands in the table; info says where a file belongs and that an unseen one is unseen."""
    cli.main(["models", "list"])
    reported = capsys.readouterr().out
    assert all(name in reported for name in CATALOGUE) and str(cache_dir) in reported
    cli.main(["models", "info", "depth-anything-outdoor"])
    reported = capsys.readouterr().out
    assert "unknown, pinned on first use" in reported and "never had this file" in reported
    assert f"{cache_dir / 'depth-anything-outdoor.onnx'} (no)" in reported


def test_errors_are_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Unknown name, missing file, damaged file, a target that is no ONNX file, a file that is no weights."""
    assert "known: big-lama" in error_line(capsys, "models", "info", "lama")
    assert "`dlama models pull mobile-sam-decoder`" in error_line(capsys, "models", "verify", "mobile-sam-decoder")
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "mobile-sam-decoder.onnx").write_bytes(b"short")
    assert "cut short: 5 bytes, expected 16496559" in error_line(capsys, "models", "verify")
    assert "ends in .onnx" in error_line(capsys, "models", "convert", "a.ckpt", "-o", str(tmp_path / "a.pt"))
    assert "no such file, and no model" in error_line(
        capsys, "models", "convert", "a.ckpt", "-o", str(tmp_path / "a.onnx")
    )
    (tmp_path / "b.ckpt").write_bytes(b"nonsense")
    assert "b.ckpt: neither a torch archive" in error_line(
        capsys, "models", "convert", str(tmp_path / "b.ckpt"), "-o", str(tmp_path / "b.onnx")
    )
    assert not (tmp_path / "b.onnx").exists()


def test_pull_of_what_is_here(
    capsys: pytest.CaptureFixture[str], cache_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody is asked, the file is checked, and its hash pinned when none is published."""
    toy = dataclasses.replace(
        CATALOGUE["mobile-sam-decoder"], name="toy", file="toy.onnx", sha256=None, bytes=None, urls=()
    )
    monkeypatch.setitem(CATALOGUE, "toy", toy)
    assert "no mirror gave the right file" in error_line(capsys, "models", "pull", "toy")
    (cache_dir / "toy.onnx").write_bytes(b"toy")
    cli.main(["models", "pull", "toy"])
    assert capsys.readouterr().out.startswith(f"{cache_dir / 'toy.onnx'}: sha256 ")
    cli.main(["models", "verify"])
    assert "toy.onnx: verified, sha256" in capsys.readouterr().out


def test_convert(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The file carries the licence that was reported; conversions of numbers are said; nothing half is left."""
    onnx = pytest.importorskip("onnx")
    source, target = write_weights(tmp_path / "w.safetensors", half=True), tmp_path / "new" / "w.onnx"
    cli.main(["models", "convert", str(source), "-o", str(target), "--licence", "MIT"])
    reported = capsys.readouterr().out
    assert "4 -> 3 planes, 1 blocks, licence MIT" in reported and "F16 were converted to float32" in reported
    contract = json.loads(next(p.value for p in onnx.load(target).metadata_props if p.key == "dlama.contract"))
    assert contract["licence"] == "MIT" and contract["source"] == "w.safetensors"
    assert [path.name for path in target.parent.iterdir()] == ["w.onnx"]
    cli.main(["models", "convert", str(source), "-o", str(target)])
    assert "licence of these weights is not known" in capsys.readouterr().out


def test_model_for_converts_once(capsys: pytest.CaptureFixture[str], tmp_path: Path, cache_dir: Path) -> None:
    """The second call returns the same file untouched; other bytes under the same name give another file."""
    pytest.importorskip("onnx")
    source = write_weights(tmp_path / "w.safetensors")
    first = model_for(source)
    assert first.parent == cache_dir / "converted" and "converted to" in capsys.readouterr().err
    stamp = first.stat().st_mtime_ns
    assert model_for(str(source)) == first and first.stat().st_mtime_ns == stamp
    assert capsys.readouterr().err == ""
    write_weights(source, half=True)
    assert model_for(source) != first


@pytest.mark.parametrize("damage", ["flipped", "empty", "no hash", "empty hash"])
def test_a_damaged_converted_network_is_made_anew(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, cache_dir: Path, damage: str
) -> None:
    """Oracle: the bytes of the first time; the note says so."""
    pytest.importorskip("onnx")
    source = write_weights(tmp_path / "w.safetensors")
    first = model_for(source)
    whole, next_to = first.read_bytes(), first.with_suffix(".sha256")
    if damage == "flipped":
        first.write_bytes(whole[:500] + bytes([whole[500] ^ 1]) + whole[501:])
    elif damage == "empty":
        first.write_bytes(b"")
    elif damage == "no hash":
        next_to.unlink()
    else:
        next_to.write_bytes(b"")
    capsys.readouterr()
    assert model_for(source) == first and first.read_bytes() == whole
    assert "is not as it was written; it is made anew" in capsys.readouterr().err
    assert model_for(source) == first and capsys.readouterr().err == ""
    assert sorted(path.suffix for path in first.parent.iterdir()) == [".onnx", ".sha256"]


def test_model_for_other_words(tmp_path: Path, cache_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An ONNX file is taken as it is; a name of the catalogue must have been pulled; anything else lists the names."""
    (tmp_path / "a.onnx").write_bytes(b"")
    assert model_for(tmp_path / "a.onnx") == tmp_path / "a.onnx"
    with pytest.raises(FileError, match="`dlama models pull mobile-sam-decoder`"):
        model_for("mobile-sam-decoder")
    monkeypatch.setitem(
        CATALOGUE, "toy", dataclasses.replace(CATALOGUE["mobile-sam-decoder"], file="toy.onnx", bytes=3)
    )
    cache_dir.mkdir()
    (cache_dir / "toy.onnx").write_bytes(b"toy")
    assert model_for("toy") == model_for(Path("toy")) == cache_dir / "toy.onnx"
    with pytest.raises(InputError, match=r"nope: no such file, and no model of the catalogue is called so \(big-lama"):
        model_for("nope")


def test_help_has_no_warnings(capsys: pytest.CaptureFixture[str]) -> None:
    """Options are called as the documentation says, without prefixes."""
    with warnings.catch_warnings(), pytest.raises(SystemExit):
        warnings.simplefilter("error")
        cli.main(["models", "convert", "--help"])
    shown = capsys.readouterr()
    assert "--output FILE.onnx" in shown.out and "--licence SPDX" in shown.out
    assert "task" not in shown.out and "warning" not in shown.err
