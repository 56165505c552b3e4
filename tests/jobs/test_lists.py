"""Lists in several forms, and folders of pictures (oracles: rows by hand, files written by pyarrow)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from dlama.errors import FileError, InputError
from dlama.jobs.batch import JobList
from dlama.jobs.lists.folders import Pictures

ROWS = [
    {"id": "a", "verb": "view", "image": "x.png", "yaw": 3, "_note": "kept out"},
    {"id": "b/c", "verb": "view", "image": "/whole/y.png", "yaw": -4.5, "_note": None},
]


def jobs_of(path: Path) -> list[tuple[str, str, dict[str, object], str | None]]:
    """What a list says."""
    return [(job.id, job.verb, dict(job.parameters), job.error) for job in JobList(path, None, {"fov": 60})]


def test_all_forms_say_the_same(tmp_path: Path) -> None:
    """Paths start from the list's folder, defaults fill in, empty values and notes are left out (oracle: by hand)."""
    expected = [
        ("a", "view", {"fov": 60.0, "image": str(tmp_path / "x.png"), "yaw": 3.0}, None),
        ("b/c", "view", {"fov": 60.0, "image": "/whole/y.png", "yaw": -4.5}, None),
    ]
    (tmp_path / "jobs.jsonl").write_text("\n".join(map(json.dumps, ROWS)) + "\n\n")
    lines = ["\ufeffid,verb,image,yaw,fov,_note", "a,view,x.png,3,,hi", "", ",,,, ,", "b/c, view ,/whole/y.png,-4.5,,"]
    (tmp_path / "jobs.csv").write_text("\n".join(lines), encoding="utf-8")
    assert jobs_of(tmp_path / "jobs.jsonl") == jobs_of(tmp_path / "jobs.csv") == expected


@pytest.mark.parametrize(
    ("own", "left"),
    [
        ({"yaw": 3, "camera": "/k.json"}, {"pitch": 2.0}),
        ({"yaw": 3, "fx": 90}, {"pitch": 2.0}),
        ({"to": "/to.json"}, {"fov": 60.0}),
        ({"yaw": 3, "cx": 9}, {"fov": 60.0, "pitch": 2.0}),
    ],
)
def test_the_value_in_a_row_wins_also_where_it_has_another_name(own: dict[str, Any], left: dict[str, Any]) -> None:
    """Defaults that say the same in another way do not count (oracle: by hand)."""
    row = {"id": "a", "verb": "view", "image": "/x.png"}
    (job,) = JobList([row | own], None, {"fov": 60, "pitch": 2})
    assert job.error is None and dict(job.parameters) == {"image": "/x.png", **own, **left}


def test_parquet(tmp_path: Path) -> None:
    """As JSONL (oracle: pyarrow wrote it)."""
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    parquet.write_table(pyarrow.Table.from_pylist(ROWS), tmp_path / "jobs.parquet")
    (tmp_path / "jobs.jsonl").write_text("\n".join(map(json.dumps, ROWS)))
    assert jobs_of(tmp_path / "jobs.parquet") == jobs_of(tmp_path / "jobs.jsonl")
    (tmp_path / "bad.parquet").write_bytes(b"no table")
    with pytest.raises(FileError, match=r"bad.parquet: is no Parquet file"):
        jobs_of(tmp_path / "bad.parquet")


def test_results_of_an_earlier_run_are_no_pictures_of_a_pattern(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those below the output are left out, unless the pattern looks for them there, or all lies in the output (by hand)."""
    for name in ("a.png", "x/b.png", "out/a/image.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    for output in ("out", "x/../out", str(tmp_path / "out")):
        assert [row["id"] for row in Pictures("**/*.png", output=output)] == ["a", "x/b"]
    assert [row["id"] for row in Pictures("out/**/image.png", output="out")] == ["a/image"]
    assert [row["id"] for row in Pictures("**/*.png", output=".")] == ["a", "out/a/image", "x/b"]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "id;verb;image\n", "line 1: values are separated by semicolons; commas are expected"),
        ("a.csv", "id\tverb\timage\n", "line 1: values are separated by tabs; commas are expected"),
        ("a.csv", "verb,image\n", "line 1: there is no column id; the columns are verb, image"),
        ("a.csv", "", "line 1: is empty; columns are expected"),
        ("a.csv", "id,id\n", "line 1 has column 'id' twice"),
        ("a.csv", "id,verb\na\n", "line 2: has 1 values; 2 are expected"),
        ("a.csv", "id,verb\n", "a.csv: lists no job; one row or more is expected"),
        ("a.jsonl", "\n\n", "a.jsonl: lists no job; one row or more is expected"),
        ("a.jsonl", "{nonsense\n", "line 1:1:2: is no JSON"),
        ("a.jsonl", '{"id": "a", "id": "b"}\n', "line 1: field 'id' is given twice"),
        ("a.jsonl", "[" * 100_000, "line 1: is no JSON"),
        ("a.jsonl", "[1]\n", "line 1: is list; an object"),
        ("a.jsonl", '{"id": "a", "yaww": 3}\n', "line 1: column 'yaww' is no parameter"),
        ("a.txt", "", "is no job list; a name that ends in .csv, .jsonl"),
    ],
)
def test_lists_that_are_none(tmp_path: Path, name: str, text: str, message: str) -> None:
    """Messages by hand."""
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        jobs_of(tmp_path / name)
    with pytest.raises(FileError, match="cannot be read: no such file"):
        jobs_of(tmp_path / "nothing.csv")
    (tmp_path / "bytes.csv").write_bytes(b"id\n\xff\xfe\n")
    with pytest.raises(FileError, match="is no text in UTF-8"):
        jobs_of(tmp_path / "bytes.csv")


def test_pictures_of_a_pattern(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sorted, each with its depth and mask; ids are paths below the fixed folders (oracle: by hand)."""
    for name in ("s2/rgb/1.png", "s1/rgb/2.png", "s1/rgb/1.png", "s1/depth/1.exr"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    rows = list(Pictures("s1/rgb/*.png", "s1/depth/{stem}.exr", "masks/{name}"))
    assert [row["id"] for row in rows] == ["1", "2"]
    assert rows[0] == {"id": "1", "image": "s1/rgb/1.png", "depth": "s1/depth/1.exr", "mask": "masks/1.png"}
    deep = list(Pictures(f"{tmp_path}/**/rgb/*.png", "{folder}/../depth/{stem}.exr"))
    assert [row["id"] for row in deep] == ["s1/rgb/1", "s1/rgb/2", "s2/rgb/1"]
    assert deep[2]["depth"] == f"{tmp_path}/s2/rgb/../depth/1.exr"
    for name in ("shot [A]/rgb/1.png", "shot A/rgb/3.png"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).touch()
    assert [row["image"] for row in Pictures("shot [A]/rgb/*.png")] == ["shot [A]/rgb/1.png"]
    assert [row["image"] for row in Pictures("s[12]/rgb/1.png")] == ["s1/rgb/1.png", "s2/rgb/1.png"]
    (tmp_path / "IMG [2].jpg").touch()
    assert list(Pictures("IMG [2].jpg")) == [{"id": "IMG [2]", "image": "IMG [2].jpg"}]
    with pytest.raises(
        InputError, match=r"images is 's1/rgb'; no .*, it is a folder; s1/rgb/\*.jpg takes what is in it"
    ):
        list(Pictures("s1/rgb"))
    with pytest.raises(InputError, match=r"images is 'x/\*.png'; no picture is called so$"):
        list(Pictures("x/*.png"))
    with pytest.raises(InputError, match=r"depths is '\{steam\}.png'; \{stem\}, \{name\} and \{folder\}"):
        list(Pictures("s1/rgb/*.png", "{steam}.png"))
