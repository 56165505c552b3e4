"""Fields of JSON files: every bad one named by file, line, column or field (oracle: the text written here)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlama.errors import FileError
from dlama.files.fields import FileFields, json_fields, read_json_fields


def test_json_objects(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('\ufeff{"name": "x", "list": [1], "part": {"n": 2}}', encoding="utf-8")
    fields = read_json_fields(path)
    assert fields.text("name") == "x" and fields.entries("list", "numbers") == [1]
    assert fields.part("part", fields.values["part"]).number("n") == 2
    with pytest.warns(
        UserWarning, match=r"a\.json: fields that are not known are not used: 'list'; known are name, part$"
    ):
        fields.warn_of_unknown(["name", "part"])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [("{,", r"a\.json:1:2: is no JSON"), ("[1]", r"a\.json:1:1: holds a JSON list"), ("[" * 10**5, r"is no JSON")],
)
def test_what_is_no_object(text: str, complaint: str) -> None:
    with pytest.raises(FileError, match=complaint):
        json_fields("a.json", text)


def test_fields_of_another_kind() -> None:
    fields = FileFields("a.json", {"name": 3, "list": [], "part": 4})
    with pytest.raises(FileError, match=r"a\.json: name is 3; a text is expected"):
        fields.text("name")
    with pytest.raises(FileError, match=r"a\.json: list is \[\]; a list of numbers is expected"):
        fields.entries("list", "numbers")
    with pytest.raises(FileError, match=r"a\.json: part is 4; an object with named fields is expected"):
        fields.part("part", fields.values["part"])
