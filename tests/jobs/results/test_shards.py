"""Tar shards (oracles: the webdataset package, the same list without shards)."""

from __future__ import annotations

import json
import tarfile
from itertools import chain
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest
from small_jobs import FAST, contents, table, view_rows, write_csv

import dlama
from box_frame import small_frame
from dlama.errors import InputError, OutputError
from dlama.jobs.batch import batch
from dlama.jobs.report import write_report
from dlama.jobs.results.manifest import Manifest
from dlama.jobs.results.result import JobResult
from dlama.jobs.results.tar_shards import Packer, key_of
from dlama.jobs.storage import Output


def run(folder: Path, rows: list[dict[str, Any]], out: str = "out", **options: Any) -> list[dlama.JobResult]:
    """The results of a list in shards of 3."""
    path = write_csv(small_frame(folder) / "jobs.csv", rows)
    return list(batch(path, folder / out, **{**FAST, "workers": 1, "pack": 3} | options))


def keys(folder: Path) -> dict[str, list[str]]:
    """Shard -> keys of its samples, in order."""
    found = {}
    for path in sorted((folder / "shards").iterdir()):
        with tarfile.open(path) as shard:
            names = [name for name in shard.getnames() if name.endswith(".meta.json")]
        found[path.name] = [name.removesuffix(".meta.json") for name in names]
    return found


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.filterwarnings("ignore")  # files that webdataset leaves open
def test_webdataset_reads_what_was_written(tmp_path: Path) -> None:
    """Every sample once, its files byte for byte those of the run without shards; an id's dots stay out of the ending."""
    webdataset = pytest.importorskip("webdataset")
    rows = [*view_rows(6), {**view_rows(1)[0], "id": "v1.5/a%b.c"}]
    assert {row.status for row in run(tmp_path, rows)} == {"done"}
    run(tmp_path, rows, "plain", pack=None)
    plain = contents(tmp_path / "plain")
    shards = sorted(str(path) for path in (tmp_path / "out" / "shards").iterdir())
    assert [Path(path).name for path in shards] == ["000000.tar", "000001.tar", "000002.tar"]
    seen = {}
    for sample in webdataset.WebDataset(shards, shardshuffle=False):
        name = unquote(sample["__key__"])
        seen[name] = sample
        for file in ("image.png", "depth.png", "depth.exr"):
            assert sample[file] == plain[f"{name}/{file}"]
        assert json.loads(sample["meta.json"])["inputs"].keys() == {"image", "depth"}
    assert sorted(seen) == sorted(str(row["id"]) for row in rows)
    assert not (tmp_path / "out" / "staged").exists()
    written = table(tmp_path / "out")
    assert {row["folder"] for row in written.values()} == {f"shards/00000{n}.tar" for n in range(3)}


@pytest.mark.usefixtures("in_this_process")
def test_a_rerun_keeps_shards_and_what_is_done_again_leaves_its_old_one(tmp_path: Path) -> None:
    """Oracle: the keys of all shards: each id once, also after a change and after a shard was lost."""
    rows = view_rows(6)
    run(tmp_path, rows, ordered=True)
    assert all(row.kept for row in run(tmp_path, rows))
    rows[1]["yaw"] = 20
    assert [row.id for row in run(tmp_path, rows) if not row.kept] == ["v/001"]
    assert keys(tmp_path / "out") == {
        "000000.tar": ["v/000", "v/002"], "000001.tar": ["v/003", "v/004", "v/005"], "000002.tar": ["v/001"],
    }  # fmt: skip
    (tmp_path / "out" / "shards" / "000001.tar").unlink()
    assert sorted(row.id for row in run(tmp_path, rows) if not row.kept) == ["v/003", "v/004", "v/005"]
    assert sorted(chain(*keys(tmp_path / "out").values())) == [row["id"] for row in rows]


@pytest.mark.usefixtures("in_this_process")
def test_what_is_done_again_without_shards_leaves_its_old_one(tmp_path: Path) -> None:
    """Oracle: the keys of all shards and the folders: each id once, also where the run that did it again was interrupted."""
    rows = view_rows(6)
    run(tmp_path, rows, ordered=True)
    rows[1]["yaw"] = rows[4]["yaw"] = 20
    interrupted = batch(write_csv(tmp_path / "jobs.csv", rows), tmp_path / "out", **FAST, workers=1)
    while next(interrupted).id != "v/001":
        pass
    interrupted.close()  # type: ignore[attr-defined]
    run(tmp_path, rows, pack=None)
    assert keys(tmp_path / "out") == {"000000.tar": ["v/000", "v/002"], "000001.tar": ["v/003", "v/005"]}
    assert sorted(path.name for path in (tmp_path / "out" / "v").iterdir()) == ["001", "004"]
    assert all(row.kept for row in run(tmp_path, rows, pack=None))
    run(tmp_path, rows)
    assert sorted(chain(*keys(tmp_path / "out").values())) == [row["id"] for row in rows]


def test_a_damaged_shard_is_named(tmp_path: Path) -> None:
    """Law: no bare error; the page about the run is written without its pictures, and what to do is said."""
    shard = tmp_path / "shards" / "000000.tar"
    shard.parent.mkdir()
    shard.write_bytes(b"no tar file" * 100)
    (tmp_path / "staged" / "a").mkdir(parents=True)
    output = Output(str(tmp_path))
    with Manifest(output) as manifest:
        manifest.add(JobResult("a", "done", "view", folder="shards/000000.tar", hole_share=0.5))
        assert "Largest holes" in Path(write_report(tmp_path)).read_text("utf-8")
        again = JobResult("a", "done", "view", folder="staged/a", replaces="shards/000000.tar")
        with pytest.raises(OutputError, match=r"000000\.tar: is no whole tar file .* remove it"):
            Packer(output, manifest, 1).add(again)


@pytest.mark.usefixtures("in_this_process")
def test_what_waits_is_packed_by_the_next_run(tmp_path: Path) -> None:
    """A run that is left in the middle: nothing is done twice, and every id is in one shard at the end."""
    rows = view_rows(5)
    path = write_csv(small_frame(tmp_path) / "jobs.csv", rows)
    first = batch(path, tmp_path / "out", workers=1, pack=4, **FAST)
    done = {next(first).id, next(first).id}
    first.close()  # type: ignore[attr-defined]
    results = run(tmp_path, rows, pack=4)
    assert done <= {row.id for row in results if row.kept}
    assert sorted(chain(*keys(tmp_path / "out").values())) == [row["id"] for row in rows]


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("entered", [0, 2])
def test_a_run_killed_while_it_packs_leaves_no_second_sample(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, entered: int
) -> None:
    """A shard is whole, and only `entered` of its rows are in the manifest (oracle: every id in one shard, once)."""
    rows, add = view_rows(5), Manifest.add
    left = [entered]

    def add_some(manifest: Manifest, row: JobResult) -> None:
        if row.folder.startswith("shards/"):
            left[0] -= 1
            if left[0] < 0:
                raise KeyboardInterrupt
        add(manifest, row)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Manifest, "add", add_some)
        run(tmp_path, rows, pack=4)
    assert keys(tmp_path / "out")["000000.tar"] == [row["id"] for row in rows[:4]]
    assert sum(not row.kept for row in run(tmp_path, rows, pack=4)) == 1
    assert sorted(chain(*keys(tmp_path / "out").values())) == [row["id"] for row in rows]


@pytest.mark.usefixtures("in_this_process")
def test_a_run_that_packed_nothing_is_packed_by_a_later_one(tmp_path: Path) -> None:
    """Oracle: shards of the same list packed at once; nothing is done twice, and no folder of a result is left."""
    rows = view_rows(5)
    run(tmp_path, rows, pack=None)
    rows[1]["yaw"] = 20
    assert [row.id for row in run(tmp_path, rows, ordered=True) if not row.kept] == ["v/001"]
    run(tmp_path, rows, "packed", ordered=True)
    assert keys(tmp_path / "out") == keys(tmp_path / "packed")
    assert not (tmp_path / "out" / "v").exists()
    assert {row["folder"] for row in table(tmp_path / "out").values()} == {"shards/000000.tar", "shards/000001.tar"}
    assert all(row.kept for row in run(tmp_path, rows))


def test_keys_and_numbers() -> None:
    """Round trip by the standard library's reader of %2E; two ids never share a key."""
    for name in ("a", "a.b/c.d", "100%", "%2E", "a%.b"):
        assert unquote(key_of(name)) == name and "." not in key_of(name)
    with pytest.raises(InputError, match="pack is 0"):
        batch([], "out", pack=0)
