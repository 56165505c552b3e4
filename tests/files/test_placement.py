"""Results appear whole or not at all (oracle: what lies on the disk before and after)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlama.errors import OutputError
from dlama.files.atomic_write import new_directory, new_file


class Boom(Exception):
    """Something that goes wrong half-way."""


def everything(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_new_file_appears_on_success_only(tmp_path: Path) -> None:
    target = tmp_path / "depth.png"
    with new_file(target) as draft:
        draft.write_text("half")
        assert draft.suffix == ".png" and not target.exists()
    assert target.read_text() == "half" and everything(tmp_path) == ["depth.png"]


def test_failed_file_keeps_the_old_one(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(Boom), new_file(target) as draft:
        draft.write_text("half")
        raise Boom
    assert target.read_text() == "old" and everything(tmp_path) == ["a.txt"]


def test_new_file_has_ordinary_rights(tmp_path: Path) -> None:
    """Oracle: a file made by open()."""
    (tmp_path / "plain").touch()
    with new_file(tmp_path / "ours") as draft:
        draft.write_text("x")
    with new_directory(tmp_path / "folder"):
        pass
    (tmp_path / "plain_folder").mkdir()
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode
    assert (tmp_path / "folder").stat().st_mode == (tmp_path / "plain_folder").stat().st_mode


@pytest.mark.parametrize("place", ["file/out.png", "no/such/folder/out.png", "."])
def test_unwritable_file_is_an_output_error(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written"), new_file(tmp_path / place) as draft:
        draft.write_text("x")
    assert everything(tmp_path) == ["file"]


def test_new_directory_is_made_with_its_parents(tmp_path: Path) -> None:
    with new_directory(tmp_path / "a" / "b") as draft:
        (draft / "x.txt").write_text("1")
        (draft / "right").mkdir()
        (draft / "right" / "y.txt").write_text("2")
        assert not (tmp_path / "a" / "b").exists()
    assert everything(tmp_path) == ["a", "a/b", "a/b/right", "a/b/right/y.txt", "a/b/x.txt"]


def test_failed_directory_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(Boom), new_directory(tmp_path / "a" / "b") as draft:
        (draft / "x.txt").write_text("1")
        raise Boom
    assert everything(tmp_path) == []


def test_existing_directory_is_merged_and_survives_failure(tmp_path: Path) -> None:
    (tmp_path / "right").mkdir()
    (tmp_path / "right" / "old.txt").write_text("old")
    (tmp_path / "image.txt").write_text("old")
    with pytest.raises(Boom), new_directory(tmp_path) as draft:
        (draft / "image.txt").write_text("new")
        raise Boom
    assert (tmp_path / "image.txt").read_text() == "old" and len(everything(tmp_path)) == 3
    with new_directory(tmp_path) as draft:
        (draft / "image.txt").write_text("new")
        (draft / "right").mkdir()
        (draft / "right" / "new.txt").write_text("new")
    assert (tmp_path / "image.txt").read_text() == "new"
    assert everything(tmp_path) == ["image.txt", "right", "right/new.txt", "right/old.txt"]


@pytest.mark.parametrize("place", ["file", "file/below", "/proc/dlama/out"])
def test_unwritable_directory_is_an_output_error(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OutputError, match="cannot be written"), new_directory(tmp_path / place):
        pass
    assert everything(tmp_path) == ["file"]
