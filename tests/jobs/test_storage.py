"""Lists, inputs and results that lie elsewhere (oracles: the same list on this computer's file system, byte for byte)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from small_jobs import FAST, contents, view_rows, write_csv

from box_frame import small_frame
from dlama.errors import FileError
from dlama.jobs.batch import batch
from dlama.jobs.storage import Output, fetch, file_stamp, folder_of, is_address, open_to_read

fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed: extra `batch`")


@pytest.fixture
def memory(tmp_path: Path, in_this_process: None) -> Any:
    """fsspec's memory with a small frame and a list in memory://in."""
    system = fsspec.filesystem("memory")
    system.store.clear()
    system.pseudo_dirs[:] = [""]
    write_csv(small_frame(tmp_path) / "jobs.csv", view_rows(3))
    for name in ("image.png", "depth.png", "jobs.csv"):
        system.pipe_file(f"/in/{name}", (tmp_path / name).read_bytes())
    return system


def test_all_of_it_elsewhere(tmp_path: Path, memory: Any) -> None:
    """List, inputs and results by address: pictures are those of the local run, meta.json names addresses."""
    results = list(batch("memory://in/jobs.csv", "memory://out", workers=1, **FAST))
    assert [row.status for row in results] == ["done"] * 3
    list(batch(tmp_path / "jobs.csv", tmp_path / "out", workers=1, **FAST))
    local = contents(tmp_path / "out")
    assert {name.removeprefix("/out/") for name in memory.store if "/v/" in name} == set(local)
    for name, content in local.items():
        if not name.endswith("meta.json"):
            assert memory.cat_file(f"/out/{name}") == content
    meta = json.loads(memory.cat_file("/out/v/000/meta.json"))
    assert meta["inputs"]["image"]["path"] == "memory://in/image.png"
    table = memory.cat_file("/out/manifest.csv").decode().splitlines()
    assert [line.split(",")[:2] for line in table[1:]] == [[f"v/{n:03d}", "done"] for n in range(3)]
    again = list(batch("memory://in/jobs.csv", "memory://out", workers=1, **FAST))
    assert all(row.kept for row in again)
    memory.pipe_file("/in/image.png", (tmp_path / "mask.png").read_bytes())
    again = list(batch("memory://in/jobs.csv", "memory://out", workers=1, **FAST))
    assert not any(row.kept for row in again)


def test_the_marker_comes_last(tmp_path: Path, memory: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever file fails, there is no meta.json, so there is no result; the next attempt makes it whole (oracle: the store)."""
    folder = tmp_path / "result"
    folder.mkdir()
    for name in ("meta.json", "a.png", "z.png"):
        (folder / name).write_text(name)
    output, order, failing = Output("memory://out"), list[str](), set[str]()
    put = type(memory).put_file

    def noted(self: Any, source: str, target: str, **more: Any) -> Any:
        order.append(target.rpartition("/")[2])
        if order[-1] in failing:
            raise OSError("connection lost")
        return put(self, source, target, **more)

    monkeypatch.setattr(type(memory), "put_file", noted)
    for name in ("a.png", "z.png", "meta.json"):
        failing.add(name)
        with pytest.raises(OSError, match="connection lost"):
            output.put(folder, "x")
        assert not output.has("x")
        failing.clear()
    order.clear()
    output.put(folder, "x")
    assert order == ["a.png", "z.png", "meta.json"] and output.has("x")
    failing.add("a.png")
    with pytest.raises(OSError, match="connection lost"):
        output.put(folder, "x")
    assert not output.has("x")


def test_an_id_that_ends_like_a_shard(tmp_path: Path, memory: Any) -> None:
    """By hand: its folder, left by an attempt that failed, is no shard whose marker could be removed."""
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "meta.json").write_text("{}")
    memory.makedirs("/out/x.tar")
    Output("memory://out").put(tmp_path / "result", "x.tar")
    assert memory.cat_file("/out/x.tar/meta.json") == b"{}"


def test_a_missing_input_is_one_failed_row(memory: Any) -> None:
    """With its address."""
    memory.rm_file("/in/depth.png")
    results = list(batch("memory://in/jobs.csv", "memory://out", workers=1, **FAST))
    assert {row.error_kind for row in results} == {"FileError"}
    assert results[0].error.startswith("memory://in/depth.png: cannot be read")


def test_addresses(tmp_path: Path) -> None:
    """By hand; file:// is this computer."""
    assert is_address("s3://a/b") and not is_address("/a/b") and not is_address("file:///a/b")
    assert folder_of("s3://a/b/jobs.csv") == "s3://a/b" and folder_of(str(tmp_path / "jobs.csv")) == str(tmp_path)
    (tmp_path / "a.txt").write_text("text")
    with open_to_read(f"file://{tmp_path}/a.txt") as stream:
        assert stream.read() == "text"
    assert file_stamp(str(tmp_path / "a.txt")) and file_stamp(str(tmp_path / "b.txt")) == ""
    with pytest.raises(FileError, match="nonsense://a/b"), fetch({"image": "nonsense://a/b"}):
        pass
