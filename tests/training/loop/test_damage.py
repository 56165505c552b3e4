"""Run directories that were killed early, damaged, or are in use (oracles: one whole run, flipped bytes, real processes)."""

from __future__ import annotations

import errno
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from toy_runs import read_metrics, toy

from dlama.errors import FileError, OutputError
from dlama.training.loop import callbacks, run_files
from dlama.training.loop.checkpointing import read_checkpoint, write_checkpoint
from dlama.training.loop.run_files import LAST, METRICS, SETTINGS, MetricsTable, lock_run
from dlama.training.loop.train import train


class Killed(BaseException):
    """Stands for SIGKILL."""


@pytest.fixture(scope="module")
def one_step(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of one step, for the fixture `run` to copy."""
    return train(toy(steps=1), tmp_path_factory.mktemp("whole") / "run").run


@pytest.fixture
def run(one_step: Path, tmp_path: Path) -> Path:
    """A run of one step, to be damaged."""
    return shutil.copytree(one_step, tmp_path / "run")


@pytest.fixture(scope="module")
def killed_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that was killed after its first step, before any checkpoint, for the fixture `killed` to copy."""

    def kill(*_: object) -> None:
        raise Killed

    run = tmp_path_factory.mktemp("killed") / "run"
    with pytest.MonkeyPatch.context() as broken:
        broken.setattr(callbacks.RunCallback, "on_train_batch_end", kill)
        with pytest.raises(Killed):
            train(toy(steps=2), run)
    assert (run / SETTINGS).is_file() and not (run / LAST).exists()
    return run


@pytest.fixture
def killed(killed_run: Path, tmp_path: Path) -> Path:
    """A run that was killed before any checkpoint, to continue with."""
    return shutil.copytree(killed_run, tmp_path / "run")


@pytest.mark.parametrize("resume", [False, True])
def test_a_run_killed_before_its_first_checkpoint_begins_anew(killed: Path, resume: bool) -> None:
    assert train(toy(steps=2), killed, resume=resume).step == 2
    assert [row["step"] for row in read_metrics(killed)] == [1, 2]


def test_every_flipped_bit_of_the_weights_is_seen(tmp_path: Path) -> None:
    """One bit in the middle of a tensor; and a file cut short, or empty."""
    path = tmp_path / LAST
    write_checkpoint(path, {"version": 1, "weights": torch.arange(10_000.0)})
    assert read_checkpoint(path)["weights"][9] == 9
    whole = path.read_bytes()
    middle = whole.index(torch.arange(5000.0, 5010.0).numpy().tobytes())
    path.write_bytes(whole[:middle] + bytes([whole[middle] ^ 4]) + whole[middle + 1 :])
    with pytest.raises(FileError, match=r"last\.ckpt: is damaged: the checksum of .* is wrong"):
        read_checkpoint(path)
    for part in (b"", whole[: len(whole) // 2], whole[:-10], b"\0" * len(whole)):
        path.write_bytes(part)
        with pytest.raises(FileError, match=r"last\.ckpt: cannot be read as a checkpoint"):
            read_checkpoint(path)


@pytest.mark.parametrize("missing", ["state_dict", "optimizer_states"])
def test_a_checkpoint_that_lacks_a_part_is_refused(run: Path, missing: str) -> None:
    found = read_checkpoint(run / LAST)
    del found[missing]
    write_checkpoint(run / LAST, found)
    with pytest.raises(FileError, match="does not fit the run's settings, or is damaged"):
        train(toy(steps=2), run, resume=True)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"{", b"[1]", b'{"loop": 3}'])
def test_broken_settings_are_named(killed: Path, content: bytes) -> None:
    (killed / LAST).touch()
    (killed / SETTINGS).write_bytes(content)
    with pytest.raises(FileError, match=r"settings\.json"):
        train(toy(steps=2), killed, resume=True)


def test_rows_that_are_whole_are_kept(tmp_path: Path) -> None:
    """Of a table with lines that are too long or too short."""
    (tmp_path / METRICS).write_bytes(b"step,samples\n1,2,3,4\n\n,\n")
    MetricsTable(tmp_path, ["loss"], 1).add({"step": 2, "loss": 0.5})
    assert [row["step"] for row in read_metrics(tmp_path)] == [1, 2]


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01", b"a,b\n1,2\n"])
def test_a_table_that_is_none_is_named_and_left(tmp_path: Path, content: bytes) -> None:
    """Oracle: the error, and the bytes of the file."""
    (tmp_path / METRICS).write_bytes(content)
    with pytest.raises(FileError, match=r"metrics\.csv: (cannot be read|is damaged)"):
        MetricsTable(tmp_path, ["loss"], 1)
    assert (tmp_path / METRICS).read_bytes() == content


def test_two_processes_do_not_train_in_one_directory(killed: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from dlama.training.loop.run_files import lock_run\n"
        "with lock_run(Path(sys.argv[1])):\n    print('ready', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(killed)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None and other.stdout.readline() == b"ready\n"
        with pytest.raises(OutputError, match="another process trains there"):
            train(toy(steps=1), killed, resume=True)
        other.kill()
    with lock_run(killed):
        pass


def test_a_full_disk_does_not_end_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Neither rows nor sheets nor log lines need to be written; the last checkpoint does."""

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    def full_table(self: MetricsTable, run: Path, columns: list[str], step: int) -> None:
        self.path, self.columns = Path("/dev/full"), ["step", "samples", "seconds", *columns]

    monkeypatch.setattr(MetricsTable, "__init__", full_table)
    monkeypatch.setattr(callbacks, "write_sheet", full)
    monkeypatch.setattr(run_files, "LOG_FILE", "/dev/full")
    assert train(toy(steps=2, sheet_every=1), tmp_path / "run").step == 2
    assert sum("no space left" in line.lower() and "the run continues" in line for line in caplog.messages) == 4
