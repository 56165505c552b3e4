"""A server that speaks S3, on this computer (oracle: the same list on this computer's file system, byte for byte)."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from small_jobs import FAST, contents, view_rows, write_csv

from box_frame import small_frame
from dlama.jobs.batch import batch

pytest.importorskip("s3fs", reason="s3fs is not installed")
server = pytest.importorskip("moto.server", reason="moto is not installed")


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A bucket of its own on a server of moto's; worker processes find it by the environment."""
    import s3fs

    running = server.ThreadedMotoServer(port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    for name, value in (
        ("AWS_ENDPOINT_URL", f"http://{host}:{port}"),
        ("AWS_ACCESS_KEY_ID", "one"),
        ("AWS_SECRET_ACCESS_KEY", "two"),
        ("AWS_DEFAULT_REGION", "us-east-1"),
    ):
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()
    name = f"frames-{uuid.uuid4().hex[:8]}"  # servers in one process share their memory
    s3fs.S3FileSystem().mkdir(name)
    yield f"s3://{name}"
    s3fs.S3FileSystem.clear_instance_cache()
    running.stop()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of moto's and botocore's own
def test_list_inputs_and_results_on_a_server(bucket: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """By a worker process, and packed in shards; a second run keeps all of it."""
    import s3fs

    system, jobs = s3fs.S3FileSystem(), f"{bucket}/in/jobs.csv"
    write_csv(small_frame(tmp_path) / "jobs.csv", view_rows(3))
    for name in ("image.png", "depth.png", "jobs.csv"):
        system.put_file(str(tmp_path / name), f"{bucket}/in/{name}")
    results = list(batch(jobs, f"{bucket}/out", workers=1, **FAST))
    assert [row.status for row in results] == ["done"] * 3, results[0].error
    request.getfixturevalue("in_this_process")
    list(batch(tmp_path / "jobs.csv", tmp_path / "out", workers=1, **FAST))
    local = contents(tmp_path / "out")
    written = {name.partition("/out/")[2]: name for name in system.find(f"{bucket}/out/v")}
    assert set(written) == set(local)
    for name, content in local.items():
        assert name.endswith("meta.json") or system.cat_file(written[name]) == content
    list(batch(jobs, f"{bucket}/packed", workers=1, pack=2, **FAST))
    names = {name.partition("/packed/")[2] for name in system.find(f"{bucket}/packed")}
    assert {"shards/000000.tar", "shards/000001.tar", "manifest.csv"} < names
    assert not [name for name in names if name.startswith("staged")]
    for place, pack in (("out", None), ("packed", 2)):
        assert all(row.kept for row in batch(jobs, f"{bucket}/{place}", workers=1, pack=pack, **FAST))
