"""Where model files lie, which messages their absence gives, and what verifying says of them."""

from __future__ import annotations

import dataclasses
import hashlib
import re
from pathlib import Path

import pytest

from dlama.errors import FileError, InputError, OutputError
from dlama.models import records
from dlama.models.cache import directory, known_size_and_sha256, locate, read_pins, user_path
from dlama.models.records import CATALOGUE, Record, record
from dlama.models.verify import verify

TOY = Record("toy", "a toy", ("http://a/b",), hashlib.sha256(b"toy").hexdigest(), 3, "MIT", "mask-network", "toy.onnx")


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch, cache_dir: Path) -> Path:
    """A catalogue that also knows `toy`; the path of its file."""
    monkeypatch.setitem(records.CATALOGUE, "toy", TOY)
    cache_dir.mkdir()
    return cache_dir / "toy.onnx"


def test_records_are_whole() -> None:
    """Form of every record: https, 64 digits, one file name each."""
    assert len({entry.file for entry in CATALOGUE.values()}) == len(CATALOGUE)
    for name, entry in CATALOGUE.items():
        assert name == entry.name and entry.urls and all(url.startswith("https://") for url in entry.urls)
        assert entry.sha256 is None or re.fullmatch("[0-9a-f]{64}", entry.sha256)
        assert Path(entry.file).name == entry.file and "\n" not in entry.what + entry.note


def test_an_unknown_name_lists_the_known() -> None:
    """So that a typing error is seen at once."""
    with pytest.raises(InputError, match=r"no model is called 'big-lame'; known: big-lama, depth-anything-small"):
        record("big-lame")


def test_the_directory(monkeypatch: pytest.MonkeyPatch, cache_dir: Path) -> None:
    """DLAMA_MODELS names it, with ~; else it is the user's cache directory."""
    assert directory() == cache_dir
    monkeypatch.setenv("DLAMA_MODELS", "~/m")
    assert directory() == Path.home() / "m"
    monkeypatch.delenv("DLAMA_MODELS")
    assert directory().parts[-2:] == ("dlama", "models") and directory().is_absolute()


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"a": ', "[1]", '{"toy.onnx": 3}'], ids=["deep", "cut", "list", "number"]
)
def test_damaged_pins_are_named(toy: Path, text: str) -> None:
    """One error of the package, which says what to do; never overwritten silently."""
    toy.write_bytes(b"first")
    (toy.parent / "pins.json").write_text(text)
    for read in (read_pins, lambda: verify(dataclasses.replace(TOY, sha256=None, bytes=None))):
        with pytest.raises(FileError, match=r"pins\.json: .*remove it to pin every file anew"):
            read()


def test_locate(toy: Path) -> None:
    """The file; a missing one names the command and the way by hand; one of another size is refused."""
    with pytest.raises(FileError, match=r"`dlama models pull toy`.*By hand: download http://a/b .*toy\.onnx"):
        locate("toy")
    toy.write_bytes(b"to")
    with pytest.raises(FileError, match="2 bytes, the model toy has 3; replace it with `dlama models pull toy`"):
        locate("toy")
    toy.write_bytes(b"toy")
    assert locate("toy") == toy


def test_verify(toy: Path) -> None:
    """Each state in words; a known hash is not pinned."""
    assert verify(TOY).state == "missing" and "dlama models pull toy" in verify(TOY).detail
    wrong = {b"to": "cut short: 2 bytes", b"toys": "too long: 4 bytes", b"tow": "corrupted or replaced"}
    for data, words in wrong.items():
        toy.write_bytes(data)
        assert verify(TOY).state == "wrong" and verify(TOY).detail.startswith(words)
    toy.write_bytes(b"toy")
    assert verify(TOY).state == "verified"
    assert not (toy.parent / "pins.json").exists()


def test_verify_pins_once(toy: Path) -> None:
    """A hash that nobody published is written down, then compared; `locate` then knows the size too."""
    unknown = dataclasses.replace(TOY, sha256=None, bytes=None)
    toy.write_bytes(b"first")
    assert [verify(unknown).state, verify(unknown).state] == ["pinned", "verified"]
    toy.write_bytes(b"other")
    assert verify(unknown).state == "wrong"
    assert known_size_and_sha256(unknown)[0] == 5


def test_no_home_is_an_error_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """`~` where no home is known: every option that names a network (oracle: the message names it)."""
    with pytest.raises(FileError, match=r"~nobody-x/m\.onnx: no home folder is known"):
        user_path("~nobody-x/m.onnx")
    monkeypatch.setenv("DLAMA_MODELS", "~nobody-x")
    with pytest.raises(FileError, match="no home folder"):
        directory()


def test_pins_that_cannot_be_written(toy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An OutputError that names the list."""

    def refuse(draft: Path, target: Path) -> None:
        raise PermissionError(13, "Permission denied")

    toy.write_bytes(b"first")
    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(OutputError, match=r"pins\.json: cannot be written"):
        verify(dataclasses.replace(TOY, sha256=None, bytes=None))
