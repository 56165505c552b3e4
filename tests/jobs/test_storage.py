"""Lists, inputs and results that lie elsewhere (oracles: the same list on this computer's file system, byte for byte)."""

from __future__ import annotations

import io
import json
import tarfile
import uuid
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from small_jobs import FAST, contents, view_rows, write_csv

from box_frame import small_frame
from dlama.errors import FileError
from dlama.jobs.batch import batch
from dlama.jobs.results.manifest import Manifest
from dlama.jobs.results.tar_shards import Packer
from dlama.jobs.storage import Output, fetch, file_stamp, file_system, folder_of, is_address, open_to_read

fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed: extra `batch`")


@pytest.fixture
def memory() -> Any:
    """fsspec's memory, empty."""
    system = fsspec.filesystem("memory")
    system.store.clear()
    system.pseudo_dirs[:] = [""]
    return system


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A bucket of its own on a server of moto's, which is found by the environment."""
    s3fs = pytest.importorskip("s3fs", reason="s3fs is not installed")
    server = pytest.importorskip("moto.server", reason="moto is not installed")
    running = server.ThreadedMotoServer(port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    keys = {"AWS_ACCESS_KEY_ID": "one", "AWS_SECRET_ACCESS_KEY": "two", "AWS_DEFAULT_REGION": "us-east-1"}
    for name, value in {"AWS_ENDPOINT_URL": f"http://{host}:{port}", **keys}.items():
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()
    name = f"frames-{uuid.uuid4().hex[:8]}"  # servers in one process share their memory
    s3fs.S3FileSystem().mkdir(name)
    yield f"s3://{name}/"
    s3fs.S3FileSystem.clear_instance_cache()
    running.stop()


@pytest.fixture(
    params=[
        "memory",
        pytest.param("bucket", marks=[pytest.mark.slow, pytest.mark.filterwarnings("ignore")]),  # of moto's own
    ]
)
def root(tmp_path: Path, in_this_process: None, request: pytest.FixtureRequest) -> str:
    """The address of a store with a small frame and a list in in/."""
    store = request.getfixturevalue(request.param)
    found = store if isinstance(store, str) else "memory://"
    system, _ = file_system(found)
    write_csv(small_frame(tmp_path) / "jobs.csv", view_rows(3))
    for name in ("image.png", "depth.png", "jobs.csv"):
        system.pipe_file(f"{found}in/{name}", (tmp_path / name).read_bytes())
    return found


def test_all_of_it_elsewhere(tmp_path: Path, root: str) -> None:
    """List, inputs and results by address, also packed in shards: pictures are those of the local run, meta.json names addresses;
    a second run keeps all of it, until an input changes."""
    system, _ = file_system(root)
    jobs = f"{root}in/jobs.csv"
    results = list(batch(jobs, f"{root}out", workers=1, **FAST))
    assert [row.status for row in results] == ["done"] * 3, results[0].error
    list(batch(tmp_path / "jobs.csv", tmp_path / "out", workers=1, **FAST))
    local = contents(tmp_path / "out")
    written = {name.partition("out/")[2]: name for name in system.find(f"{root}out/v")}
    assert set(written) == set(local)
    for name, content in local.items():
        assert name.endswith("meta.json") or system.cat_file(written[name]) == content
    meta = json.loads(system.cat_file(f"{root}out/v/000/meta.json"))
    assert meta["inputs"]["image"]["path"] == f"{root}in/image.png"
    table = system.cat_file(f"{root}out/manifest.csv").decode().splitlines()
    assert [line.split(",")[:2] for line in table[1:]] == [[f"v/{n:03d}", "done"] for n in range(3)]
    list(batch(jobs, f"{root}packed", workers=1, pack=2, **FAST))
    names = {name.partition("packed/")[2] for name in system.find(f"{root}packed")}
    assert {"shards/000000.tar", "shards/000001.tar", "manifest.csv"} < names
    assert not [name for name in names if name.startswith("staged")]
    for place, pack in (("out", None), ("packed", 2)):
        assert all(row.kept for row in batch(jobs, f"{root}{place}", workers=1, pack=pack, **FAST))
    system.pipe_file(f"{root}in/image.png", (tmp_path / "mask.png").read_bytes())
    assert not any(row.kept for row in batch(jobs, f"{root}out", workers=1, **FAST | {"only": "image"}))
    left = [name.partition("v/000/")[2] for name in system.find(f"{root}out/v/000")]
    assert sorted(left) == ["image.png", "meta.json"]


def test_a_run_killed_while_it_packs_leaves_no_second_sample(root: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its rows since the shard was written are lost, as they are sent now and then (oracle: every id in one shard, once)."""
    system, _ = file_system(root)
    jobs, write = f"{root}in/jobs.csv", Packer._write
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):

        def kill(packer: Packer, name: str, members: Iterable[tuple[str, bytes]]) -> None:
            write(packer, name, members)
            patch.setattr(Manifest, "send", lambda _: None)
            raise KeyboardInterrupt

        patch.setattr(Packer, "_write", kill)
        list(batch(jobs, f"{root}killed", workers=1, pack=2, **FAST))
    list(batch(jobs, f"{root}killed", workers=1, pack=2, **FAST))
    found = []
    for name in system.find(f"{root}killed/shards"):
        with tarfile.open(fileobj=io.BytesIO(system.cat_file(name))) as shard:
            found += [one for one in shard.getnames() if one.endswith("meta.json")]
    assert sorted(found) == [f"v/{n:03d}.meta.json" for n in range(3)]


def test_what_is_not_there_is_named_as_missing(memory: Any) -> None:
    """A list, and an input, that the store does not hold (oracle: the words of a local list)."""
    lost = "memory://in/lost.csv: cannot be read: no such file or directory"
    with pytest.raises(FileError, match=f"^{lost}$"), open_to_read("memory://in/lost.csv"):
        pass
    with pytest.raises(FileError, match=f"^{lost}$"), fetch({"image": "memory://in/lost.csv"}):
        pass


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


def test_a_missing_input_is_one_failed_row(root: str) -> None:
    """With its address."""
    file_system(root)[0].rm_file(f"{root}in/depth.png")
    results = list(batch(f"{root}in/jobs.csv", f"{root}out", workers=1, **FAST))
    assert {row.error_kind for row in results} == {"FileError"}
    assert results[0].error.startswith(f"{root}in/depth.png: cannot be read")


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
