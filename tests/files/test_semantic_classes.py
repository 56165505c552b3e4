"""SemanticClasses.csv: colours by name, as Unreal writes it, and every bad line named (oracle: the lines written here)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlama.errors import FileError
from dlama.files.semantic_classes import class_color, read_classes

TABLE = "sky, 70,130,180\nchair, old,255,0,0\n\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_names_may_hold_commas_in_any_encoding_of_unreal(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "SemanticClasses.csv"
    path.write_text(TABLE, encoding=encoding)
    assert read_classes(path) == {"sky": (70, 130, 180), "chair, old": (255, 0, 0)}
    assert class_color("chair, old", tmp_path / "picture.png") == (255, 0, 0)
    assert class_color("1, 2,3", tmp_path / "picture.png") == (1, 2, 3)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("sky,70,130\n", r"SemanticClasses.csv:1: the line is 'sky,70,130'; name,R,G,B of 0 to 255 each is expected"),
        ("a,0,0,0\nsky,70, 256,1\n", r"SemanticClasses.csv:2: the line is 'sky,70, 256,1'; name,R,G,B of 0"),
        ("sky,0,0,0\nsky,1,1,1\n", r"SemanticClasses.csv:2: class 'sky' is there for the second time"),
    ],
)
def test_bad_lines_are_named(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "SemanticClasses.csv"
    path.write_text(text)
    with pytest.raises(FileError, match=complaint):
        read_classes(path)
